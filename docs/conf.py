"""Configuration of the documentation: `make docs` builds it, with warnings as errors and nothing from outside."""

import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT))

project = "tissue-rig"
copyright = "2026, the authors of tissue-rig"
extensions = ["myst_parser", "tools.mathml", "tools.reference"]
myst_enable_extensions = ["dollarmath", "deflist"]
# Links from one page to a heading of another are checked down to this level.
myst_heading_anchors = 3
html_math_renderer = "mathml"
exclude_patterns = ["_build"]
nitpicky = True

html_theme = "pydata_sphinx_theme"
html_title = "tissue-rig"
html_static_path = ["_static"]
html_css_files = ["wide.css"]
html_show_sourcelink = False
html_copy_source = False
html_theme_options = {
    "navbar_end": ["theme-switcher"],
    "primary_sidebar_end": [],
    "footer_start": ["copyright"],
    "footer_end": [],
    "show_toc_level": 2,
}
