"""Sphinx configuration: MyST pages, notebooks with the outputs that they store, a reference from the docstrings."""

from __future__ import annotations

import sys
from pathlib import Path

DOCS = Path(__file__).resolve().parent
ROOT = DOCS.parent
sys.path[:0] = [str(ROOT), str(DOCS / "_ext")]

import rsibr  # noqa: E402  # found in the checkout, whatever is installed

project = "rsibr"
author = "The rsibr authors"
copyright = "The rsibr authors"
version = release = rsibr.__version__

extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.napoleon",
    "sphinx_copybutton",
    "docstrings",
    "mathml",
    "pages",
]
exclude_patterns = ["_build", "**/.ipynb_checkpoints"]

# MyST: a heading of any page can be linked to; notebooks show what they store and are never run here
myst_enable_extensions = ["colon_fence", "deflist", "dollarmath", "amsmath", "fieldlist"]
myst_heading_anchors = 4
nb_execution_mode = "off"
nb_merge_streams = True

# Reference
autodoc_default_options = {"members": True, "member-order": "bysource", "show-inheritance": True}
autodoc_typehints = "signature"
autodoc_typehints_format = "short"
autodoc_preserve_defaults = True
autodoc_type_aliases = {"ArrayLike": "ArrayLike"}
autoclass_content = "class"
autosummary_generate = False  # the extension `pages` writes them
napoleon_google_docstring = False
napoleon_use_ivar = True
napoleon_use_rtype = False

suppress_warnings = ["ref.python"]  # two classes of one short name: the type in a docstring links to the first
add_module_names = False
python_use_unqualified_type_names = True

# HTML: everything that a page loads lies beside it
html_theme = "furo"
html_title = f"rsibr {release}"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_theme_options = {"navigation_with_keys": True}
html_show_sphinx = False
html_copy_source = False
copybutton_prompt_text = r">>> |\.\.\. |\$ "
copybutton_prompt_is_regexp = True
