"""What a test of `rivid check` says that it tried."""

from tests.faults.conftest import tried

__all__ = ["tried"]
