"""Build hook: compiles the libraries of the native FMUs, which a wheel carries for all platforms, and notes the commit.

``ziglang``, a build requirement, compiles for all of them; libraries that the checkout has kept are taken as they are.
The first time takes some minutes of processor time. ``HYBRIDSEP_TARGETS`` (names of ``hybridsep build --target`` with
commas, or ``none``) leaves platforms out. Where it fails, the installation goes on without them, and says so: the
Python flavour of the FMUs remains. An editable installation finds them in ``build/binaries``, where those of other
platforms come when they are first asked for: it compiles this machine's alone. It asks git for the commit.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface


class ReleaseHook(BuildHookInterface[Any]):
    """Add libraries and commit to a wheel, the commit to an sdist."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Compile what is missing, and say how long it took."""
        sys.path.insert(0, self.root)
        try:
            files = self._commit()
            if self.target_name == "wheel":
                files |= self._libraries(this_machine_alone=version == "editable")
        finally:
            sys.path.remove(self.root)
        if version != "editable":
            build_data["force_include"].update(files)

    def _commit(self) -> dict[str, str]:
        """Return the file with the commit: path → place; none where there is no commit."""
        from hybridsep.base.version import COMMIT_FILE, commit

        file = Path(self.root) / COMMIT_FILE
        if not file.is_file():  # as in a checkout; an sdist has it
            made_from = commit(Path(self.root))
            if not made_from:
                return {}
            file = Path(self.root) / "build" / "commit.txt"
            file.parent.mkdir(exist_ok=True)
            file.write_text(f"{made_from}\n", encoding="utf-8")
        return {str(file): COMMIT_FILE}

    def _libraries(self, this_machine_alone: bool) -> dict[str, str]:
        """Return the libraries: path → place; none where they cannot be compiled."""
        try:
            from hybridsep.fmi.c_header import KINDS
            from hybridsep.fmi.compiler import TARGETS, host_target
            from hybridsep.fmi.libraries import chosen_targets, library_paths

            targets = chosen_targets()
            if this_machine_alone:
                targets = tuple(target for target in targets if target == host_target())
            begin = time.monotonic()
            self.app.display_info("libraries of the native FMUs; the first time takes some minutes of processor time")
            paths = library_paths([(kind, target) for kind in KINDS for target in targets])
            self.app.display_info(f"{len(paths)} libraries after {time.monotonic() - begin:.0f} s")
        except Exception as error:  # whatever it is, the library without them is better than none
            self.app.display_warning(f"no libraries of the native FMUs, whose Python flavour remains: {error}")
            return {}
        return {
            str(path): f"hybridsep/_data/binaries/{kind}/{target}{TARGETS[target].suffix}"
            for (kind, target), path in paths.items()
        }
