"""The documentation site; scripts/docs builds it.

Environment: PENDULA_PROGRAM, the program whose help and models are shown; PYTHONPATH, with the Python package.
"""

import logging
import os
import re
import sys
from pathlib import Path

from sphinx.application import Sphinx

DOCS = Path(__file__).parent
ROOT = DOCS.parent
sys.path.insert(0, str(DOCS / "extensions"))
# Notebooks and their shells find the program, and keep kernels of models where the build does.
os.environ["PATH"] = f"{Path(os.environ['PENDULA_PROGRAM']).parent}:{os.environ['PATH']}"
os.environ.setdefault("MPLBACKEND", "module://matplotlib_inline.backend_inline")

project = "pendula"
author = "pendula contributors"
project_copyright = f"2026, {author}"
release = version = re.search(r"project\(pendula VERSION ([0-9.]+)", (ROOT / "CMakeLists.txt").read_text())[1]

extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "breathe",
    "sphinx_copybutton",
    "sphinx_design",
    "mathml",
    "cpp_headers",
    "program_help",
    "live_pages",
]
exclude_patterns = ["requirements.txt", "extensions"]
nitpicky = True
# Types of NumPy, Eigen and the standard library have no page here.
nitpick_ignore_regex = [(r"(py|cpp):.*", r".*")]

myst_enable_extensions = ["colon_fence", "deflist", "dollarmath"]
myst_heading_anchors = 4
nb_execution_mode = "force"
nb_execution_show_tb = True  # a cell that fails is a warning, and so the end of scripts/docs
nb_execution_timeout = 120
nb_merge_streams = True

autodoc_member_order = "bysource"
autodoc_mock_imports = ["torch"]  # large
autodoc_typehints = "none"  # docstrings say types and shapes
napoleon_google_docstring = False
napoleon_use_rtype = False

copybutton_prompt_text = r">>> |\.\.\. |\$ "
copybutton_prompt_is_regexp = True

html_theme = "furo"
html_title = f"pendula {release}"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_js_files = ["site.js"]
html_copy_source = False
html_show_sourcelink = False
html_show_search_summary = False  # it would fetch pages, which nothing may from a disk
html_theme_options = {"navigation_with_keys": True}


def setup(app: Sphinx) -> None:
    """Notebooks run without the settings of whoever builds the site, and say nothing of their kernels."""
    profile = Path(app.doctreedir) / "ipython/profile_default"
    profile.mkdir(parents=True, exist_ok=True)
    (profile / "ipython_kernel_config.py").write_text("c.IPKernelApp.log_level = 'ERROR'\n")
    os.environ["IPYTHONDIR"] = str(profile.parent)
    logging.getLogger("traitlets").setLevel(logging.ERROR)
