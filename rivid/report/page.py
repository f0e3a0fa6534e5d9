"""Pages from templates: escaped, in one piece, and bound to ask nothing of anybody.

A page ``name.html.j2`` has its style beside it in ``name.css``. The policy in its head names the one style
sheet that a browser may use, by hash, and where pictures may come from; all else is refused.
"""

import base64
import hashlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rivid.atomic import write_text


def write_page(path: Path, name: str, context: Mapping[str, Any]) -> Path:
    """Write a page.

    Parameters
    ----------
    path : Path
        Where to.
    name : str
        Of the template, without its ending.
    context : mapping
        What the template names, all of it; strings are escaped.

    Returns
    -------
    Path
        The page.

    Raises
    ------
    RividError
        Where it cannot be written.
    """
    from jinja2 import Environment, PackageLoader, StrictUndefined
    from markupsafe import Markup

    loader = PackageLoader("rivid", "templates")
    environment = Environment(
        loader=loader, autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    style = loader.get_source(environment, f"{name}.css")[0]
    digest = base64.b64encode(hashlib.sha256(style.encode()).digest()).decode("ascii")
    given = {**context, "style": Markup(style), "style_hash": f"sha256-{digest}"}
    write_text(path, environment.get_template(f"{name}.html.j2").render(given))
    return path
