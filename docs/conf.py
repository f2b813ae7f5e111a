"""How Sphinx makes the pages: `make docs`."""

import inspect
import os
import sys
from pathlib import Path

import capslip

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE / "_ext"))
os.environ.setdefault("PYVISTA_OFF_SCREEN", "true")

project = "capslip"
author = "The capslip developers"
project_copyright = author
version = release = capslip.__version__
extensions = [
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "numpydoc",
    "myst_parser",
    "sphinx_design",
    "sphinx_gallery.gen_gallery",
    "run",
    "shown",
    "pages",
]
exclude_patterns = ["_ext", "_templates", "examples", "gallery/*.ipynb", "sg_execution_times.rst"]
templates_path = ["_templates"]
nitpicky = True
smartquotes = False  # --unit is no dash
highlight_language = "text"
default_role = "literal"  # as the docstrings mean it
pygments_style = "sphinx"
# Nothing is fetched: no inventories of other projects, no formulas drawn elsewhere.

myst_enable_extensions = ["colon_fence", "deflist"]
myst_heading_anchors = 3

autosummary_generate = True
autodoc_typehints = "none"  # they stand in the sections of the docstrings
autodoc_member_order = "bysource"
numpydoc_show_class_members = False

sphinx_gallery_conf = {
    "examples_dirs": "examples",
    "gallery_dirs": "gallery",
    "filename_pattern": r"/plot_",
    "run_stale_examples": True,
    "abort_on_example_error": True,
    "download_all_examples": False,
    "notebook_extensions": set(),
    "capture_repr": (),
    "show_memory": False,
    "show_signature": False,
    "min_reported_time": 1e9,
    "write_computation_times": False,
    "backreferences_dir": None,
    "reset_modules": ("matplotlib",),
    "within_subsection_order": "FileNameSortKey",
}
suppress_warnings = ["config.cache"]  # of functions in sphinx_gallery_conf

html_theme = "pydata_sphinx_theme"
html_title = "capslip"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_show_sourcelink = False
html_copy_source = False
html_theme_options = {
    "logo": {"text": "capslip"},
    "navbar_end": ["theme-switcher", "navbar-icon-links"],
    "show_prev_next": False,
    "header_links_before_dropdown": 5,
    "secondary_sidebar_items": ["page-toc"],
    "footer_start": ["copyright"],
    "footer_end": [],
    "navigation_with_keys": False,
}
html_sidebars = {path.stem: [] for path in HERE.glob("*.md") if path.stem != "api"}


def setup(app) -> None:
    """Show the names alone where defaults would fill half a page."""
    app.connect("autodoc-process-signature", _short)


def _short(_app, what, _name, thing, _options, signature, annotation):
    if what != "class" or len(signature or "") < 200:
        return signature, annotation
    return f"({', '.join(inspect.signature(thing).parameters)})", annotation
