"""A pytest plugin (``-p tests.faults.recording``): outcomes, and what was tried, to a JSON file.

Where ``RIVID_FAULTS`` names a file, each test that ran is kept there with its outcome, its seconds and the
notes of the fixture `tried`. ``python -m benchmarks.reliability`` makes docs/reliability.md of it.
"""

import json
import os
from pathlib import Path

TESTS: dict[str, dict] = {}


def pytest_runtest_logreport(report):
    """Keep the outcome; a failure in any phase is the test's."""
    kept = TESTS.setdefault(report.nodeid, {"outcome": "passed", "seconds": 0.0, "tried": []})
    kept["seconds"] += report.duration
    if report.outcome != "passed":
        kept["outcome"] = report.outcome
    if report.when == "teardown":
        kept["tried"] = [value for name, value in report.user_properties if name == "tried"]


def pytest_sessionfinish(session):
    """Write what was kept, once: not in the processes of xdist."""
    path = os.environ.get("RIVID_FAULTS")
    if path and not hasattr(session.config, "workerinput"):
        Path(path).parent.mkdir(parents=True, exist_ok=True)
        Path(path).write_text(json.dumps(TESTS, indent=1, sort_keys=True) + "\n", encoding="utf-8")
