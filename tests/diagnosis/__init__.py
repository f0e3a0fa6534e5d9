"""Tests of a diagnosis. Random cases are few by default, and complete when marked `long`."""

import pytest


def sizes(name, small, full):
    """Parametrise `name` by a small case and, marked `long`, the full one."""
    return pytest.mark.parametrize(name, [small, pytest.param(full, marks=pytest.mark.long)])
