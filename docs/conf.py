"""Settings of the documentation: `make docs` builds docs/_build/html. Nothing is loaded from the network."""

from __future__ import annotations

import re
import sys
from pathlib import Path

from sphinx.application import Sphinx

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE), str(HERE.parent)]

from generate import write_generated_pages  # noqa: E402

from softflagella import __version__, write_page  # noqa: E402

write_generated_pages(HERE / "reference" / "generated")
write_page(HERE / "reference" / "generated" / "beside" / "plan.html")

project = "softflagella"
author = "the softflagella developers"
project_copyright = author
release = version = __version__
extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx.ext.viewcode"]
exclude_patterns = ["_build", "reference/generated", "**/.ipynb_checkpoints"]
nb_execution_mode = "force"  # notebooks are kept without outputs
nb_execution_timeout = 600  # seconds a cell
nb_execution_in_temp = True
nb_execution_raise_on_error = True
nb_merge_streams = True
default_role = "code"
maximum_signature_line_length = 80
myst_heading_anchors = 3
autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_type_aliases = {"ArrayLike": "ArrayLike", "Floats": "Floats", "Integers": "Integers"}
autodoc_default_options = {"members": True, "exclude-members": "__init__, __new__"}
napoleon_numpy_docstring = False
napoleon_use_rtype = False
napoleon_use_ivar = True
html_theme = "furo"
html_title = f"softflagella {release}"
html_static_path = ["_static"]
html_extra_path = ["reference/generated/beside"]  # the page that plans
html_css_files = ["site.css"]
html_copy_source = False
html_show_sphinx = False


def short_aliases(
    app: Sphinx,
    what: str,
    name: str,
    documented: object,
    options: object,
    arguments: str | None,
    returned: str | None,
) -> tuple[str | None, str | None]:
    """Write type aliases by their names; Sphinx writes TypeAliasForwardRef("Floats") inside other types."""
    alias = r"TypeAliasForwardRef\('(\w+)'\)"
    plain = [re.sub(alias, r"\1", text) if text else text for text in (arguments, returned)]
    return plain[0], plain[1]


def setup(app: Sphinx) -> None:
    """Register the handlers; Sphinx calls this."""
    app.connect("autodoc-process-signature", short_aliases)
