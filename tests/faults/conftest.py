"""What a test of a fault says of itself: what it injected, and how often."""

import pytest


@pytest.fixture
def tried(record_property):
    """Note an injection: ``tried("SIGKILL of the run", 50)``; :mod:`tests.faults.recording` keeps it."""

    def note(what: str, times: int = 1) -> None:
        record_property("tried", [what, times])

    return note
