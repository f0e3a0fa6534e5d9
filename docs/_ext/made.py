"""Puts what is made of the package in place of ``<!-- made: NAME -->`` in a page."""

import re
from collections.abc import Callable

import contract
import house
import keys
from sphinx.application import Sphinx

from rivid.config import Config
from rivid.scenario import Scenario

MARK = re.compile(r"^<!-- made: ([\w ]+) -->$", re.M)
MADE: dict[str, Callable[[], str]] = {
    "config": lambda: keys.markdown(Config),
    "scenario": lambda: keys.markdown(Scenario),
    "results": contract.results,
    "effects": contract.effects,
    "exits": contract.exits,
    "verdicts": contract.verdicts,
    "house": house.drawing,
}


def filled(text: str) -> str:
    """The text with all its marks replaced; an unknown one is a KeyError."""
    return MARK.sub(lambda found: MADE[found[1]](), text)


def setup(app: Sphinx) -> dict[str, bool]:
    """Fill each page as it is read."""

    def fill(_: Sphinx, __: str, source: list[str]) -> None:
        source[0] = filled(source[0])

    app.connect("source-read", fill)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
