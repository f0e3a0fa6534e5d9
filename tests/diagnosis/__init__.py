"""Tests of a diagnosis: random cases are few by default, and as many as needed when marked `long`."""

import pytest


def sizes(name, small, full):
    """Parametrise `name` by a small case and, marked `long`, the full one."""
    return pytest.mark.parametrize(name, [small, pytest.param(full, marks=pytest.mark.long)])
