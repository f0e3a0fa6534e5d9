"""The house, floor by floor, from the test of its layers and from what each room says of itself."""

import ast
import html
from pathlib import Path

ROOT = Path(__file__).parents[2]
UNSAID = {"reach": "what a reach and its people do to flows"}
"""Of rooms that say nothing of themselves; see docs/design.md."""


def floors() -> list[set[str]]:
    """The rooms of each floor, from the ground up."""
    tree = ast.parse((ROOT / "tests" / "test_layers.py").read_text(encoding="utf-8"))
    for node in tree.body:
        if isinstance(node, ast.Assign) and getattr(node.targets[0], "id", "") == "ORDER":
            return [set(floor) for floor in ast.literal_eval(node.value)]
    raise LookupError("tests/test_layers.py has no ORDER any more")


def says(room: str) -> str:
    """The first sentence of a room's docstring."""
    base = ROOT / "rivid" / room
    path = base / "__init__.py" if base.is_dir() else base.with_suffix(".py")
    if not path.exists():
        return ""
    said = ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or UNSAID.get(room, "")
    return " ".join(said.split("\n\n")[0].split()).replace("`", "").split(". ")[0].rstrip(".")


def drawing() -> str:
    """HTML, the ground at the bottom."""
    lines = ['<div class="house" role="img" aria-label="The rooms of rivid, floor by floor">']
    for floor in reversed(floors()):
        lines.append('<div class="floor">')
        for room in sorted(floor):
            wing = " wing" if (ROOT / "rivid" / room).is_dir() else ""
            name = f"{room}/" if wing else f"{room}.py"
            words = f"<b>{html.escape(name)}</b><span>{html.escape(says(room))}</span>"
            lines.append(f'<div class="room{wing}">{words}</div>')
        lines.append("</div>")
    return "\n".join([*lines, "</div>"])
