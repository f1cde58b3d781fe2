"""Settings of the documentation: ``sphinx-build -W docs build/site``."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parent))  # mathml

from hybridsep import __version__

project = "hybridsep"
author = "the authors of hybridsep"
version = release = __version__

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "mathml"]
exclude_patterns = ["**/.*"]
myst_enable_extensions = ["amsmath", "attrs_block", "deflist", "dollarmath"]
myst_heading_anchors = 3
suppress_warnings = [
    "myst.header",  # pages of experiments begin sections below tables
    "ref.python",  # shapes such as (Np,) in docstrings are no references
]

autodoc_typehints = "none"  # docstrings have types, shapes and units
autodoc_member_order = "bysource"
add_module_names = False

html_theme = "furo"
html_title = f"hybridsep {version}"
html_static_path = ["_static"]
html_css_files = ["hybridsep.css"]
html_math_renderer = "mathml"
smartquotes = False  # -- begins options
html_copy_source = False
html_show_copyright = False


def setup(app: Any) -> None:
    """Leave dated pages out of the search: who looks for a word wants what holds today."""
    app.connect("env-updated", _not_searched)


def _not_searched(_app: Any, env: Any) -> None:
    for name in env.found_docs:
        if name.startswith("experiments/2"):
            env.metadata[name]["nosearch"] = ""
