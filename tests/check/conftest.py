"""Fixtures of the tests of `rivid check`."""

from tests.faults.conftest import tried

__all__ = ["tried"]
