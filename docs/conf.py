"""The documentation: `make docs` builds it into build/docs. Nothing is fetched, here or by its pages."""

import logging
import os
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE / "_ext"))
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# kernels of the examples: no one's own profile, and nothing said of TCP within this machine
os.environ["IPYTHONDIR"] = tempfile.mkdtemp(prefix="rivid-docs-")
profile = Path(os.environ["IPYTHONDIR"]) / "profile_default"
profile.mkdir()
(profile / "ipython_kernel_config.py").write_text("c.IPKernelApp.log_level = 40\n")
logging.getLogger("traitlets").setLevel(logging.WARNING)

from rivid import __version__  # noqa: E402

project = "rivid"
author = "The rivid developers"
copyright = author
release = version = __version__

extensions = [
    "myst_nb", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx_click", "sphinx_copybutton",
    "mathml", "made",
]  # fmt: skip
smartquotes = False  # --config is no dash
exclude_patterns = ["_build", "_ext", "requirements.txt"]
nitpicky = True
nitpick_ignore_regex = [
    (r"py:.*", r"(?!rivid\b).*")
]  # other packages' names: nothing is fetched to find them

myst_enable_extensions = ["dollarmath", "amsmath", "deflist", "colon_fence"]
myst_heading_anchors = 3
myst_dmath_double_inline = False

nb_execution_mode = "force"
nb_execution_raise_on_error = True
nb_execution_timeout = 120
nb_execution_excludepatterns = ["tour.ipynb"]  # run by tests/test_tour.py; it takes minutes
nb_merge_streams = True
nb_ipywidgets_js = {}

autodoc_member_order = "bysource"
autodoc_typehints = "none"  # numpydoc gives them, with shapes and units
napoleon_google_docstring = False
napoleon_use_rtype = False
napoleon_use_ivar = True

html_theme = "furo"
html_title = f"rivid {release}"
html_math_renderer = "mathml"
html_static_path = ["_static"]
html_css_files = ["rivid.css"]
html_copy_source = False
html_show_sphinx = False
html_theme_options = {
    "light_css_variables": {"color-brand-primary": "#0072B2", "color-brand-content": "#0072B2"},
    "dark_css_variables": {"color-brand-primary": "#6FB7E9", "color-brand-content": "#6FB7E9"},
}
copybutton_prompt_text = r">>> |\.\.\. |\$ "
copybutton_prompt_is_regexp = True
