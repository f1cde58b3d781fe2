"""Settings of the documentation: ``sphinx-build -W docs build/site``."""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))  # mathml, try_page

from hybridsep import __version__

project = "hybridsep"
author = "the authors of hybridsep"
version = release = __version__

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "mathml", "try_page"]
exclude_patterns = ["**/.*", "experiments/*"]  # evidence/experiments.md sums them up
myst_enable_extensions = ["amsmath", "attrs_block", "deflist", "dollarmath"]
myst_heading_anchors = 3
suppress_warnings = [
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
