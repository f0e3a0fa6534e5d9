"""Fixtures: the command in this process, and a directory like the project's root."""

from pathlib import Path

import pytest
from click.testing import CliRunner

from rivid.cli import cli

ROOT = Path(__file__).parents[2]


@pytest.fixture
def rivid():
    """Return a function that runs a command and returns click's result, with `code`, the exit code."""

    def run(*words, **more):
        result = CliRunner().invoke(cli, [str(w) for w in words], standalone_mode=False, **more)
        if result.exception is not None:
            code = getattr(result.exception, "exit_code", None)
            if code is None:
                raise result.exception
            result.code = code
        else:
            result.code = result.return_value or 0
        return result

    return run


@pytest.fixture
def project(tmp_path, monkeypatch):
    """Set the current directory to one with all files that the examples name."""
    place = tmp_path / "project"
    place.mkdir()
    for name in ("sample_data", "configs", "tests"):
        (place / name).symlink_to(ROOT / name)
    monkeypatch.chdir(place)
    return place
