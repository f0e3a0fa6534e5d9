"""The layers of the package as a figure, from tests/test_layers.py and the docstrings."""

import ast
import html
from pathlib import Path

ROOT = Path(__file__).parents[2]


def layers() -> list[set[str]]:
    """Return the folders and modules of each layer, from the bottom up."""
    tree = ast.parse((ROOT / "tests" / "test_layers.py").read_text(encoding="utf-8"))
    for node in tree.body:
        if isinstance(node, ast.Assign) and getattr(node.targets[0], "id", "") == "LAYERS":
            return [set(layer) for layer in ast.literal_eval(node.value)]
    raise LookupError("tests/test_layers.py has no LAYERS: expected a tuple of tuples of names")


def summary(name: str) -> str:
    """Return the first sentence of the docstring of a folder or module."""
    base = ROOT / "rivid" / name
    path = base / "__init__.py" if base.is_dir() else base.with_suffix(".py")
    if not path.exists():
        return ""
    text = ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or ""
    return " ".join(text.split("\n\n")[0].split()).replace("`", "").split(". ")[0].rstrip(".")


def drawing() -> str:
    """Return the figure as HTML, with the lowest layer at the bottom."""
    lines = ['<div class="layers" role="img" aria-label="The layers of rivid">']
    for layer in reversed(layers()):
        lines.append('<div class="layer">')
        for name in sorted(layer):
            folder = (ROOT / "rivid" / name).is_dir()
            label = f"<b>{html.escape(name)}{'/' if folder else '.py'}</b>"
            kind = "part folder" if folder else "part"
            lines.append(f'<div class="{kind}">{label}<span>{html.escape(summary(name))}</span></div>')
        lines.append("</div>")
    return "\n".join([*lines, "</div>"])
