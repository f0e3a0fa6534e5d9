"""Imports go downwards only, and the maths knows no files."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import rivid

ROOT = Path(rivid.__file__).parent
ORDER = [
    {"errors"},
    {"core", "input_config", "shard", "toml"},
    {"estimator_config"},
    {"config", "answers", "atomic", "lean", "leash", "reach", "settled"},
    {"tables"},
    {"effects", "logs", "results", "estimators", "page", "preload"},
    {"scenario", "seasons"},
    {"simulation", "figures", "rows"},
    {"diagnosis", "store", "merge", "report", "check", "record"},
    {"batch", "api"},
    {"workers", "plan"},
    {"cluster", "drawing"},
    {"run"},
    {"fleet"},
    {"cli"},
    {"__main__"},
]
LEVEL = {room: level for level, rooms in enumerate(ORDER) for room in rooms}
STANDARD = {"abc", "bisect", "collections", "dataclasses", "enum", "functools", "math", "typing"}
ALLOWED_OUTSIDE = {
    "core": {"numpy", "scipy", *STANDARD},
    "reach": {"numpy", "scipy", "numba", *STANDARD},
}


def room(path):
    return path.relative_to(ROOT).parts[0].removesuffix(".py")


def imports(path):
    """Full names of all modules that a file imports, functions' imports included."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            if node.module == "rivid":
                yield from (f"rivid.{alias.name}" for alias in node.names)
            else:
                yield node.module


MODULES = sorted(p for p in ROOT.rglob("*.py") if p.name != "__init__.py" or p.parent != ROOT)


@pytest.mark.parametrize("path", MODULES, ids=lambda p: str(p.relative_to(ROOT)))
def test_imports_go_downwards(path):
    here = room(path)
    assert here in LEVEL, f"{here} has no place in the layers: give it one"
    for name in imports(path):
        parts = name.split(".")
        if parts[0] == "rivid" and len(parts) > 1 and parts[1] != "__version__":
            there = parts[1]
            assert there == here or LEVEL[there] < LEVEL[here], f"{path.name} imports upwards: {name}"
        elif here in ALLOWED_OUTSIDE and parts[0] != "rivid":
            assert parts[0] in ALLOWED_OUTSIDE[here], f"{path.name}: {here} may not import {name}"


def test_importing_rivid_loads_nothing_heavy():
    heavy = "numpy pandas matplotlib scipy pyarrow"
    code = f"import rivid, sys; print([m for m in {heavy.split()} if m in sys.modules])"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True).stdout.strip() == "[]"


def test_help_loads_nothing_heavy():
    heavy = "numpy pandas matplotlib scipy pyarrow pydantic rich"
    code = (
        "import sys\nfrom rivid.cli import cli\n"
        "for words in (['--help'], ['run', '--help'], ['simulate', '--help'], ['check', '--help']):\n"
        "    cli.main(words, standalone_mode=False)\n"
        f"print('loaded', [m for m in {heavy.split()} if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.stdout.splitlines()[-1] == "loaded []", done.stdout + done.stderr
