"""Fixture to note what a test injects, and how often."""

import pytest


@pytest.fixture
def tried(record_property):
    """Return a function that notes an injection, ``tried("SIGKILL of the run", 50)``, for the record."""

    def note(what: str, times: int = 1) -> None:
        record_property("tried", [what, times])

    return note
