"""The site of the documentation: `python -m sphinx -W -b html docs build/docs` builds it, without a warning."""

from __future__ import annotations

import sys
from importlib import metadata
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))  # the extensions beside this file

project = "nlsolve"
author = "the authors of nlsolve"
release = metadata.version("nlsolve")
html_title = f"nlsolve {release}"
html_theme = "furo"
html_static_path = ["site"]
html_css_files = ["wide.css"]
html_copy_source = False
html_show_copyright = False

extensions = ["myst_nb", "sphinx.ext.autodoc", "docstrings", "flowchart", "gallery", "links", "mathematics"]
html_math_renderer = "mathml"
exclude_patterns: list[str] = []

smartquotes = False  # --retry stays --retry
myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 3  # a link to a heading is checked: page.md#words-of-the-heading
myst_heading_slug_func = "links.slug"
myst_fence_as_directive = ["mermaid"]
suppress_warnings: list[str] = []

nb_execution_mode = "force"
nb_execution_in_temp = True
nb_execution_raise_on_error = True
nb_execution_timeout = 120
nb_merge_streams = True

autodoc_member_order = "bysource"
autodoc_typehints = "none"  # the signature of a function is as its source has it
autodoc_preserve_defaults = True
nitpicky = True
nitpick_ignore_regex = [("py:.*", ".*")]  # types of other libraries, which have pages of their own elsewhere
