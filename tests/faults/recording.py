"""Plugin of pytest (``-p tests.faults.recording``) that writes outcomes and injections to a JSON file.

If ``RIVID_FAULTS`` names a file, each test is recorded there with its outcome, duration [s] and the notes of
the fixture `tried`. ``python -m benchmarks.reliability`` builds docs/reliability.md from it.
"""

import json
import os
from pathlib import Path

TESTS: dict[str, dict] = {}


def pytest_runtest_logreport(report):
    """Record the outcome; a failure in any phase counts as a failure of the test."""
    kept = TESTS.setdefault(report.nodeid, {"outcome": "passed", "seconds": 0.0, "tried": []})
    kept["seconds"] += report.duration
    if report.outcome != "passed":
        kept["outcome"] = report.outcome
    if report.when == "teardown":
        kept["tried"] = [value for name, value in report.user_properties if name == "tried"]


def pytest_sessionfinish(session):
    """Write the record once: not in the processes of xdist."""
    path = os.environ.get("RIVID_FAULTS")
    if path and not hasattr(session.config, "workerinput"):
        Path(path).parent.mkdir(parents=True, exist_ok=True)
        Path(path).write_text(json.dumps(TESTS, indent=1, sort_keys=True) + "\n", encoding="utf-8")
