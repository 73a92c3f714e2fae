"""The site: `make docs` builds it into build/docs/html; every warning is an error there.

Needs the module and the command (.venv), doxygen, and the packages of the extra `docs`; no network.
"""

import sys
from pathlib import Path

import diffnea

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE / "_ext"))

project = "diffnea"
author = "diffnea developers"
copyright = "diffnea developers, BSD-3-Clause"
version = release = diffnea.__version__

extensions = [
    "myst_nb",  # Markdown and notebooks
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx-mathjax-offline",  # formulas without a network
    "sphinx_copybutton",
    # Our own, of _ext/:
    "command_help",
    "cpp_reference",
    "effect_figures",
    "field_tables",
    "repository_links",
    "stub_signatures",
]
exclude_patterns = ["_ext", "_generated", "figures"]

# --- text ---

myst_enable_extensions = ["amsmath", "colon_fence", "deflist", "dollarmath"]
myst_heading_anchors = 4
smartquotes = False  # "--test" is an option, no dash
highlight_language = "none"

# --- notebooks: kept without outputs, executed here ---

nb_execution_mode = "cache"
nb_execution_cache_path = str(HERE.parent / "build" / "docs" / "notebooks")
nb_execution_timeout = 300  # [s] of one cell
nb_execution_raise_on_error = True
nb_merge_streams = True
nb_ipywidgets_js = {}  # would be loaded from the network

# --- Python ---

autodoc_default_options = {"members": True}
autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_preserve_defaults = False
napoleon_numpy_docstring = False
napoleon_use_rtype = False
python_maximum_signature_line_length = 88

# --- C++ ---

doxygen_file = str(HERE / "Doxyfile")

# --- looks ---

html_theme = "furo"
html_title = f"diffnea {release}"
html_static_path = ["_static"]
html_css_files = ["diffnea.css"]
html_show_sourcelink = False
html_copy_source = False
