"""What sniff proposes, as TOML: what was seen, and what is left to decide."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

FILL_IN = (
    "# fill in; what is left out is taken from the reach of the examples:",
    "# length =           # m, from dam to dam",
    "# width =            # m, mean",
    "# depth =            # m, mean",
    "# surface_area =     # m2, of the water",
    "# discharge_range =  # m3/s, as [100, 800]: lowest and highest usual",
)
"""What no export tells of a reach."""


@dataclass(frozen=True)
class Proposal:
    """What a file seems to be.

    Attributes
    ----------
    toml : str
        A configuration that `load_config` accepts, with comments.
    open_questions : list of str
        What the file alone does not tell.
    open_keys : tuple of str
        Keys of `[input]` that these are about.
    """

    toml: str
    open_questions: list[str]
    open_keys: tuple[str, ...] = ()


@dataclass
class Questions:
    """Questions so far, each with the key that it is about."""

    asked: list[tuple[str, str]] = field(default_factory=list)

    def ask(self, key: str, text: str) -> None:
        """Ask, unless there is nothing to ask."""
        if text:
            self.asked.append((key, text))


def write_toml(
    name: str,
    kind: str,
    sample_time: float,
    keys: Mapping[str, Any],
    tables: Mapping[str, Mapping[str, Any]],
    undecided: Mapping[str, tuple[Any, ...]],
    questions: Questions,
    instead: Mapping[str, list[Any]] | None = None,
) -> Proposal:
    """The proposal.

    Parameters
    ----------
    name : str
        Of the file, for the first line.
    kind : {"pool", "river"}
    sample_time : float
        [s]; beyond 1 s to a day it is left out.
    keys, tables : mapping
        Of `[input]`.
    undecided : mapping of str to tuple
        Keys that stand in a comment only, with all that they may be: so reading asks for them.
    questions : Questions
    instead : mapping of str to list, optional
        What else keys may be: in comments below them, ready to be used.
    """
    lines = [f"# Proposed for {_safe(name)}. Read it through: what follows was seen, not known."]
    lines += ["[reach]", '# name = "..."       # letters, digits, . _ -', f"kind = {said(kind)}"]
    if 1 <= sample_time <= 86_400:
        lines.append(f"sample_time = {sample_time:g}")
    lines += [*FILL_IN, "", "[input]"]
    for key, value in keys.items():
        lines.append(f"{_safe_key(key)} = {said(value)}")
        lines += [f"# {_safe_key(key)} = {said(other)}" for other in (instead or {}).get(key, ())]
    lines += [
        f"# {key} = {' or '.join(said(v) for v in values)}: choose one" for key, values in undecided.items()
    ]
    for table, entries in tables.items():
        if entries:
            lines += ["", f"[input.{table}]"]
            lines += [f"{_safe_key(key)} = {said(value)}" for key, value in entries.items()]
    lines += ["", "# Not decided:"]
    lines += [f"# - {_safe(text)}" for _, text in questions.asked]
    keyed = tuple(dict.fromkeys(key for key, _ in questions.asked if key))
    return Proposal("\n".join(lines) + "\n", [text for _, text in questions.asked], keyed)


def said(value: Any) -> str:
    """A value as TOML: JSON has the same strings and lists, but for one escape that TOML lacks."""
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007F")


def _safe(text: str) -> str:
    return "".join(c if c.isprintable() else "?" for c in text)


def _safe_key(key: str) -> str:
    return key if key.replace("_", "").isascii() and key.replace("_", "").isalnum() else said(key)
