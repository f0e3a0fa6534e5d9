"""Markdown tables, and the descriptions of parameters in docstrings."""

import ast
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
    """Unit and meaning of each parameter, of the numpydoc docstring or of the fields' own; "-" is no unit.

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
    found = _of_fields(cls)
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


def _of_fields(cls: type) -> dict[str, tuple[str, str]]:
    """Unit and meaning of each field that a string follows."""
    try:
        (node,) = ast.parse(inspect.cleandoc("\n" + inspect.getsource(cls))).body
    except (OSError, SyntaxError, TypeError):  # a class without a source file
        return {}
    assert isinstance(node, ast.ClassDef)
    return {
        field.target.id: _unit_and_meaning(" ".join(after.value.value.split()))
        for field, after in zip(node.body, node.body[1:], strict=False)
        if isinstance(field, ast.AnnAssign) and isinstance(field.target, ast.Name)
        and isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant)
        and isinstance(after.value.value, str)
    }  # fmt: skip


def _unit_and_meaning(text: str) -> tuple[str, str]:
    text = text.replace("``", "`").strip().removesuffix(".")
    unit = UNIT.search(text)
    plain = UNIT.sub("", text, count=1)
    keep = plain[:2].isupper() or "_" in plain.split(" ")[0] or plain[:2] in ("T_", "K_")
    return (unit[1] if unit else "-", plain if keep else plain[:1].lower() + plain[1:])
