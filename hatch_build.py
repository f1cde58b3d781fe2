"""Build hook: compiles the libraries of the native FMUs, which a wheel carries for all platforms.

``ziglang``, a build requirement, compiles for all of them; libraries that the checkout has kept are taken as they are.
The first time takes some minutes of processor time. ``HYBRIDSEP_TARGETS`` (names of ``hybridsep build --target`` with
commas, or ``none``) leaves platforms out. Where it fails, the installation goes on without them, and says so: the
Python flavour of the FMUs remains.
"""

from __future__ import annotations

import sys
import time
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface


class FmuLibraries(BuildHookInterface):
    """Add the libraries to a wheel; an editable installation finds them in ``build/binaries``."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Compile what is missing, and say how long it took."""
        sys.path.insert(0, self.root)
        try:
            from hybridsep.fmi.c_header import KINDS
            from hybridsep.fmi.compiler import TARGETS
            from hybridsep.fmi.libraries import chosen_targets, library_paths

            targets = chosen_targets()
            begin = time.monotonic()
            self.app.display_info("libraries of the native FMUs; the first time takes some minutes of processor time")
            paths = library_paths([(kind, target) for kind in KINDS for target in targets])
            self.app.display_info(f"{len(paths)} libraries after {time.monotonic() - begin:.0f} s")
        except Exception as error:  # whatever it is, the library without them is better than none
            self.app.display_warning(f"no libraries of the native FMUs, whose Python flavour remains: {error}")
            return
        finally:
            sys.path.remove(self.root)
        if version != "editable":
            for (kind, target), path in paths.items():
                place = f"hybridsep/_data/binaries/{kind}/{target}{TARGETS[target].suffix}"
                build_data["force_include"][str(path)] = place
