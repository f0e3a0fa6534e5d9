"""Test that imports go downwards only, also inside folders, and what the mathematics imports and compiles."""

import ast
import subprocess
import sys
from functools import cache
from pathlib import Path

import rivid

ROOT = Path(rivid.__file__).parent
LAYERS = (
    ("types", "errors"),
    ("core", "atomic", "database"),
    ("input_config", "estimators"),
    ("config", "reach", "text"),
    ("effects", "logs"),
    ("simulation", "results"),
    ("check",),
    ("diagnosis",),
    ("export", "forecast"),
    ("plots",),
    ("report",),
    ("run",),
    ("api", "fleet"),
    ("cli",),
    ("__main__",),
)
"""Modules and folders of rivid/, from the bottom up; a layer imports from the previous ones."""
OUTSIDE = {
    "core": {"numpy", "scipy"},
    "reach": {"numpy", "scipy", "numba"},
    "effects": {"numpy", "scipy", "click"},
}
"""Third-party packages that the mathematics may import."""


def module_of(path):
    return ".".join(path.relative_to(ROOT.parent).with_suffix("").parts).removesuffix(".__init__")


MODULES = {module_of(path): path for path in ROOT.rglob("*.py")}


def imports(path):
    """Return the names of the modules that a file imports, in functions too, but not for types alone."""

    todo = [ast.parse(path.read_text(encoding="utf-8"))]
    while todo:
        node = todo.pop()
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test):
            continue
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            for alias in node.names:
                whole = f"{node.module}.{alias.name}"
                yield whole if whole in MODULES else node.module
        todo += (child for child in ast.iter_child_nodes(node) if not isinstance(child, ast.expr))


@cache
def imported():
    """Return the imports of each module; read in the tests, not during their collection."""
    return {name: {other for other in imports(path) if other != name} for name, path in MODULES.items()}


def circles(graph):
    """Return groups of nodes that reach each other."""
    reach = {}
    for start in graph:
        seen, todo = set(), [start]
        while todo:
            new = graph.get(todo.pop(), set()) - seen
            seen |= new
            todo += new
        reach[start] = seen
    return {frozenset(b for b in reach[a] if a in reach.get(b, ())) for a in graph if a in reach[a]}


def inside(folder):
    """Return the imports among the parts of a folder, by their first name."""
    found = {}
    for name, others in imported().items():
        if name.startswith(folder + "."):
            here = name.removeprefix(folder + ".").split(".")[0]
            there = {o.removeprefix(folder + ".").split(".")[0] for o in others if o.startswith(folder + ".")}
            found[here] = found.get(here, set()) | (there - {here})
    return found


def test_imports_go_downwards():
    level = {name: k for k, names in enumerate(LAYERS) for name in names}
    graph = inside("rivid")
    unplaced = set(graph) - set(level) - {"__init__"}
    assert not unplaced, f"give these a layer: {sorted(unplaced)}"
    upwards = [(a, b) for a, others in graph.items() for b in others if b in level and level[b] >= level[a]]
    assert upwards == []


def test_no_imports_run_in_circles():
    folders = {name.rsplit(".", 1)[0] for name in MODULES if "." in name}
    found = {folder: circles(inside(folder)) for folder in folders}
    found["modules"] = circles(imported())
    assert {name: groups for name, groups in found.items() if groups} == {}


def test_the_mathematics_imports_numerical_packages_only():
    wrong = [
        (name, other)
        for name, others in imported().items()
        for other in others
        if (top := name.split(".")[1] if "." in name else "") in OUTSIDE
        and (package := other.split(".")[0]) != "rivid"
        and package not in OUTSIDE[top] | sys.stdlib_module_names
    ]
    assert wrong == []


def test_importing_rivid_loads_nothing_heavy():
    heavy = "numpy pandas matplotlib scipy pyarrow"
    code = f"import rivid, sys; print([m for m in {heavy.split()} if m in sys.modules])"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True).stdout.strip() == "[]"


def test_help_loads_nothing_heavy():
    heavy = "numpy pandas matplotlib scipy pyarrow pydantic"
    code = (
        "import sys\nfrom rivid.cli import cli\n"
        "for words in (['--help'], ['run', '--help'], ['simulate', '--help'], ['check', '--help']):\n"
        "    cli.main(words, standalone_mode=False)\n"
        f"print('loaded', [m for m in {heavy.split()} if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.stdout.splitlines()[-1] == "loaded []", done.stdout + done.stderr


def test_compiled_loops_with_free_rounding_have_one_version():
    # The process that compiles a caller uses the callee's own version, later ones that in the caller. Both
    # are equal to the last bit unless the compiler may reorder operations.
    free, inlined, calls = set(), set(), {}
    for path in MODULES.values():
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            how = [ast.unparse(d) for d in getattr(node, "decorator_list", ()) if "njit" in ast.unparse(d)]
            if how:
                free |= {node.name} if "fastmath" in how[0] else set()
                inlined |= {node.name} if "forceinline=True" in how[0] else set()
                called = {ast.unparse(c.func) for c in ast.walk(node) if isinstance(c, ast.Call)}
                calls[node.name] = calls.get(node.name, set()) | called
    assert free and len(calls) > 50
    for _ in calls:
        free |= {name for name, called in calls.items() if called & free & inlined}
    assert not [(name, free & called - inlined) for name, called in calls.items() if free & called - inlined]
