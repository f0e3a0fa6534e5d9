"""Puts what is made of the package in place of ``<!-- made: NAME -->``; turns links to what is no page."""

import re
from collections.abc import Callable
from pathlib import Path

import contract
import keys
import layers
from sphinx.application import Sphinx

from rivid.config import Config
from rivid.simulation.scenario import Scenario

DOCS = Path(__file__).resolve().parents[1]
LINK = re.compile(r"(?<!!)\[([^\]]+)\]\((\.\./[^)#\s]+)\)")
MARK = re.compile(r"^<!-- made: ([\w ]+) -->$", re.M)
MADE: dict[str, Callable[[], str]] = {
    "config": lambda: keys.markdown(Config),
    "scenario": lambda: keys.markdown(Scenario),
    "results": contract.results,
    "effects": contract.effects,
    "exits": contract.exits,
    "verdicts": contract.verdicts,
    "layers": layers.drawing,
}


def filled(text: str) -> str:
    """The text with all its marks replaced; an unknown one is a KeyError."""
    return MARK.sub(lambda found: MADE[found[1]](), text)


def outside(text: str, folder: Path) -> str:
    """The text with links to what is no page: a file becomes a download, a directory its name."""

    def turned(found: re.Match[str]) -> str:
        words, target = found[1], (folder / found[2]).resolve()
        if target.is_relative_to(DOCS) or not target.exists():
            return found[0]  # a page, or an error that Sphinx reports
        return words if target.is_dir() else f"{{download}}`{words} <{found[2]}>`"

    return LINK.sub(turned, text)


def as_typed(lines: list[str]) -> None:
    """Examples of a command's help as code: sphinx-click keeps their lines, but takes them for prose."""
    text = "\n".join(lines)
    block = re.compile(r"^\| Examples:\n((?:\|.*\n?)+)", re.M)

    def typed(found: re.Match[str]) -> str:
        return "Examples::\n\n" + "".join(f"  {line[1:]}\n" for line in found[1].splitlines())

    lines[:] = block.sub(typed, text).split("\n")


def setup(app: Sphinx) -> dict[str, bool]:
    """Fill each page as it is read."""

    def fill(_: Sphinx, page: str, source: list[str]) -> None:
        source[0] = outside(filled(source[0]), (DOCS / page).parent)

    app.connect("source-read", fill)
    app.connect("sphinx-click-process-description", lambda app, context, lines: as_typed(lines))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
