"""Pages from templates: escaped, in one piece, without any outside request.

Every page ``name.html.j2`` extends ``base.html.j2`` and uses the one style sheet ``base.css``.
"""

import base64
import hashlib
import html
from collections.abc import Mapping
from contextlib import suppress
from functools import cache
from inspect import isfunction
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rivid import __version__, text
from rivid.atomic import write_text
from rivid.diagnosis.result import VERDICTS
from rivid.errors import RividError
from rivid.estimators import ESTIMATORS
from rivid.report import quantities as q

if TYPE_CHECKING:
    from jinja2 import Environment
    from jinja2.bccache import Bucket

    from rivid.plots.files import FigureFile


@cache
def environment() -> "Environment":
    """Return the Jinja environment of all templates, made once in a process."""
    from jinja2 import Environment, FileSystemBytecodeCache, PackageLoader, StrictUndefined
    from markupsafe import Markup

    class Cache(FileSystemBytecodeCache):
        """Compiled templates in a folder of the package, as Python's modules; saves 0.3 s per process."""

        def dump_bytecode(self, bucket: "Bucket") -> None:
            with suppress(OSError):  # a package that may not be written to, a full disk
                super().dump_bytecode(bucket)

    folder = Path(text.__file__).parent / "templates" / "__pycache__"
    with suppress(OSError):
        folder.mkdir(exist_ok=True)
    loader = PackageLoader("rivid", "templates")
    made = Environment(
        loader=loader, autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True,
        bytecode_cache=Cache(str(folder)),
    )  # fmt: skip
    style = loader.get_source(made, "base.css")[0]
    digest = base64.b64encode(hashlib.sha256(style.encode()).digest()).decode("ascii")
    made.globals |= {name: word for name, word in vars(text).items() if isfunction(word)}
    made.globals |= {"style": Markup(style), "style_hash": f"sha256-{digest}", "version": __version__}
    made.globals |= {"ESTIMATORS": ESTIMATORS, "VERDICTS": VERDICTS, "zip": zip}
    formats = (
        q.closed, q.error, q.estimate, q.name, q.p_value, q.percent, q.period, q.printable, q.size, q.when,
        text.count, caption,
    )  # fmt: skip
    made.filters |= {function.__name__: function for function in formats}
    made.filters.update(
        listed=lambda parts, last="and": text.listed(list(parts), last),
        oneline=lambda words: type(words)(q.printable(words)),  # what is escaped stays so, and is not again
        tight=lambda words: type(words)(q.tight(words)),
        initial=lambda words: words[:1].upper() + words[1:],
    )
    return made


def caption(figure: "FigureFile") -> str:
    """Return the caption of a figure, by the macro of its kind in ``captions.j2``."""
    words = environment().get_template("captions.j2").module
    macro = getattr(words, figure.kind, None) or words.paper  # type: ignore[attr-defined]
    return html.unescape(q.printable(macro(figure)))


def sentence(macro: str, *values: Any) -> str:
    """Return the text of a macro of ``diagnosis_words.j2``, on one line and without HTML escapes."""
    words = environment().get_template("diagnosis_words.j2").module
    return html.unescape(q.printable(getattr(words, macro)(*values)))


def write_page(path: Path, name: str, context: Mapping[str, Any]) -> Path:
    """Write a page from the template `name` and its variables, strings escaped; RividError if that fails."""
    write_text(path, environment().get_template(f"{name}.html.j2").render(context))
    return path


def terminal(name: str, /, **facts: Any) -> str:
    """Return the text of the template ``name.txt.j2`` for a terminal."""
    return html.unescape(environment().get_template(f"{name}.txt.j2").render(facts)).rstrip("\n")


def data_uri(path: Path, remedy: str = "draw the figures again") -> str:
    """Return a PNG file as a data URI; RividError, which ends with `remedy`, if the file cannot be read."""
    try:
        data = path.read_bytes()
    except OSError as error:
        raise RividError(f"cannot read {path}: {error.strerror}: {remedy}") from None
    return "data:image/png;base64," + base64.b64encode(data).decode("ascii")
