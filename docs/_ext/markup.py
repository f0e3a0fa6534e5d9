"""Markdown tables, and what a numpydoc docstring says of its parameters."""

import inspect
import re
from collections.abc import Iterable, Sequence

UNIT = re.compile(r"\s*\[([^\]]+)\]")


def table(heads: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A Markdown table; a bar within a cell is escaped."""
    lines = [_line(heads), _line(["---"] * len(heads)), *(_line(row) for row in rows)]
    return "\n".join(lines) + "\n"


def _line(cells: Sequence[str]) -> str:
    return "| " + " | ".join(cell.replace("|", "\\|").replace("\n", " ") for cell in cells) + " |"


def code(text: str) -> str:
    """Text as code; nothing where there is none."""
    if not text:
        return ""
    return f"`` {text} ``" if "`" in text else f"`{text}`"


def parameters(cls: type) -> dict[str, tuple[str, str]]:
    """Unit and meaning of each parameter in a numpydoc docstring, its own classes' before it; "-" is no unit.

    Examples
    --------
    >>> class Weir:
    ...     '''A weir.
    ...
    ...     Parameters
    ...     ----------
    ...     crest, bed : float
    ...         Levels [m], the higher
    ...         one first.
    ...     '''
    >>> parameters(Weir)["bed"]
    ('m', 'levels, the higher one first')
    """
    lines = inspect.cleandoc(cls.__doc__ or "").splitlines()
    found: dict[str, tuple[str, str]] = {}
    for head in ("Parameters", "Attributes"):
        if head not in lines:
            continue
        names: list[str] = []
        text: list[str] = []
        for line in [*lines[lines.index(head) + 2 :], "end"]:
            if line and not line[0].isspace():
                found |= dict.fromkeys(names, _unit_and_meaning(" ".join(text)))
                if " : " not in line:
                    break
                names, text = [name.strip() for name in line.split(" : ")[0].split(",")], []
            else:
                text.append(line.strip())
    return found


def _unit_and_meaning(text: str) -> tuple[str, str]:
    text = text.replace("``", "`").strip().removesuffix(".")
    unit = UNIT.search(text)
    plain = UNIT.sub("", text, count=1)
    keep = plain[:2].isupper() or "_" in plain.split(" ")[0] or plain[:2] in ("T_", "K_")
    return (unit[1] if unit else "-", plain if keep else plain[:1].lower() + plain[1:])
