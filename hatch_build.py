"""Build hook: compiles the libraries of the native FMUs that an installation finds, and notes the commit.

They are this machine's, half a minute of processor time at most: whoever installs from a checkout asked for no others,
which are compiled when they are. ``HYBRIDSEP_TARGETS`` (names of ``hybridsep build --target`` with commas, or ``none``)
says which ones else; a release sets ``all``, since its wheel goes to other machines, and no hook can tell one from the
other. ``ziglang``, a build requirement, compiles for all of them; libraries that the checkout has kept are taken as
they are. Where it fails, the installation goes on without them, and says so. It
asks git for the commit.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from threading import Event, Thread
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

_PAUSE = 2.0
"""Time after which compilation says again that it goes on, s: pip's progress moves with the lines of a build."""


class ReleaseHook(BuildHookInterface[Any]):
    """Add libraries and commit to a wheel, the commit to an sdist."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Compile what is missing, and say how long it took."""
        sys.path.insert(0, self.root)
        try:
            files = self._commit()
            if self.target_name == "wheel":
                files |= self._libraries()
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

    def _libraries(self) -> dict[str, str]:
        """Return the libraries: path → place; none where they cannot be compiled."""
        try:
            from hybridsep.fmi.c_header import KINDS
            from hybridsep.fmi.compile import TARGETS, chosen_targets, library_paths

            targets = chosen_targets()
            with self._lively(f"libraries of the native FMUs for {', '.join(targets) or 'no platform'}"):
                paths = library_paths(
                    [(kind, target) for target in targets for kind in KINDS],
                    lambda library, _done: self.app.display_info(f"{library[0]} for {library[1]}"),
                )
        except Exception as error:  # whatever it is, the library without them is better than none
            self.app.display_warning(f"no libraries of the native FMUs: {error}")
            return {}
        return {
            str(path): f"hybridsep/_data/binaries/{kind}/{target}{TARGETS[target].suffix}"
            for (kind, target), path in paths.items()
        }

    @contextmanager
    def _lively(self, what: str) -> Iterator[None]:
        """Say what goes on, how long it has taken after each pause, and how long in all."""
        begin, ended = time.monotonic(), Event()

        def speak() -> None:
            while not ended.wait(_PAUSE):
                self.app.display_info(f"{what}: {time.monotonic() - begin:.0f} s")

        self.app.display_info(what)
        speaker = Thread(target=speak, daemon=True)
        speaker.start()
        try:
            yield
        finally:
            ended.set()
            speaker.join()
            self.app.display_info(f"{what}: {time.monotonic() - begin:.0f} s")
