"""Settings of the documentation. Pages that state facts of the library are computed by `_extensions` at build time."""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent / "_extensions"))

import ziamath

import flocking

project = "flocking"
copyright = "the flocking contributors"
author = "the flocking contributors"
version = release = flocking.__version__
language = "en"

extensions = [
    "computed_pages",  # writes pages; must come before those that read them
    "notebook_pages",
    "api_pages",
    "plain_docstrings",
    "mathml",
    "accessible_pages",
    "list_of_pages",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "myst_parser",
    "sphinx_gallery.gen_gallery",
]
exclude_patterns = ["_build", "_extensions", "requirements.txt"]
default_role = "py:obj"
# A short name in a docstring may fit several modules; any of them will do as the target of its link.
suppress_warnings = ["ref.python"]
myst_enable_extensions = ["dollarmath", "deflist"]
myst_heading_anchors = 3

autodoc_member_order = "bysource"
# What an array is stands in the text; its type spelled out fills six lines of a signature.
autodoc_type_aliases = {"ArrayLike": "ArrayLike", "Array": "Array"}
napoleon_google_docstring = False
napoleon_use_rtype = False
python_maximum_signature_line_length = 88
python_use_unqualified_type_names = True

sphinx_gallery_conf = {
    "examples_dirs": ["../gallery"],
    "gallery_dirs": ["gallery"],
    "filename_pattern": r"/plot_",
    "image_scrapers": ("written_pictures",),
    "within_subsection_order": "FileNameSortKey",
    "show_memory": False,
    "show_signature": False,
    "write_computation_times": False,
    "download_all_examples": False,
    "abort_on_example_error": True,
}

html_theme = "furo"
html_logo = html_favicon = "images/logo.svg"
html_title = "flocking"
# A font with a table of mathematics makes brackets grow; it is copied, so that no page asks another place for it.
MATH_FONT = Path(ziamath.__file__).parent / "fonts" / "STIXTwoMath-Regular.ttf"
html_static_path = ["_static", str(MATH_FONT)]
html_css_files = ["pages.css"]
html_js_files = ["scrolled.js"]
html_math_renderer = "mathml"
html_copy_source = False
html_show_sphinx = False
html_show_copyright = False
templates_path: list[str] = []
