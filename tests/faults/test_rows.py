"""Test that the list of faults names existing tests, and contains every test here that notes injections."""

import ast
from pathlib import Path

import pytest

from tests.faults.rows import ROWS

ROOT = Path(__file__).parent.parent.parent


def names_in(path):
    """Return the tests of a file: functions, classes, and methods as Class::method."""
    found = {}
    for node in ast.parse(path.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.FunctionDef):
            found[node.name] = [argument.arg for argument in node.args.args]
        if isinstance(node, ast.ClassDef):
            found[node.name] = []
            for inner in node.body:
                if isinstance(inner, ast.FunctionDef):
                    found[f"{node.name}::{inner.name}"] = [argument.arg for argument in inner.args.args]
    return found


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row.fault[:30])
def test_the_tests_of_a_fault_exist(row):
    assert row.tests
    for test in row.tests:
        file, _, name = test.partition("::")
        assert not name or name in names_in(ROOT / file), test


def test_no_fault_that_is_tried_is_left_out():
    listed = {test for row in ROWS for test in row.tests}
    for path in [
        path for folder in ("faults", "check") for path in (ROOT / "tests" / folder).glob("test_*.py")
    ]:
        for name, arguments in names_in(path).items():
            test = f"{path.relative_to(ROOT).as_posix()}::{name}"
            assert "tried" not in arguments or test in listed or test.partition("::")[0] + "::" in listed, (
                name
            )
