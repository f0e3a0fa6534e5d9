"""Write docs/reliability.md: the injected faults, what was tried, how often, and the results.

    python -m benchmarks.reliability            the tests of `make test`
    python -m benchmarks.reliability --long     the long loops too

The tests run here and write their own records (tests/faults/recording.py). The page has no other source: each
cell of its table is built from the records.
"""

import argparse
import json
import os
import platform
import subprocess
import sys
from collections import Counter
from pathlib import Path
from typing import Any

from tests.faults.rows import ROWS, Row

ROOT = Path(__file__).parent.parent
RECORD = ROOT / "build" / "reliability.json"
PAGE = ROOT / "docs" / "reliability.md"

HEAD = """# Faults injected, and the results

Written by `python -m benchmarks.reliability --long` from the records of the tests themselves; do not edit. Faults are
real: processes are killed with SIGKILL, disks are full, limits are set in the kernel, bombs are written and read.
`tests/faults/rows.py` lists the tests of each fault; a test may be listed under several.

{summary}

The number after an injection is its count, if more than one. Repetitions inside one test ("150 mutations") count once.
"""


def main() -> int:
    """Run the tests of all faults, and write the page."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--long", action="store_true", help="the long loops too")
    parser.add_argument(
        "--kept", action="store_true", help="only write the page again, from the record in build/"
    )
    parser.add_argument("--jobs", default="auto", help="test processes; default: the number of cores")
    asked = parser.parse_args()
    code = 0 if asked.kept else run_tests(asked.long, asked.jobs)
    record = json.loads(RECORD.read_text(encoding="utf-8"))
    PAGE.write_text(page(record), encoding="utf-8")
    print(f"{PAGE.relative_to(ROOT)}: {len(record)} tests, {failed(record)} failed")
    return code


def run_tests(long: bool, jobs: str) -> int:
    """Run the tests of all rows; the record is written to :data:`RECORD`."""
    tests = sorted({test.removesuffix("::") for row in ROWS for test in row.tests})
    words = [sys.executable, "-m", "pytest", "-n", jobs, "-q", "-p", "tests.faults.recording"]
    words += [] if long else ["-m", "not long"]
    RECORD.unlink(missing_ok=True)
    environment = os.environ | {"RIVID_FAULTS": str(RECORD), "OPENBLAS_NUM_THREADS": "1"}
    environment |= {"RIVID_LONG": "1"} if long else {}  # all random examples
    return subprocess.run([*words, *tests], cwd=ROOT, env=environment).returncode


def failed(record: dict[str, Any]) -> int:
    """Return the number of failed tests."""
    return sum(kept["outcome"] != "passed" for kept in record.values())


def page(record: dict[str, Any]) -> str:
    """Return the page of a record."""
    seconds = sum(kept["seconds"] for kept in record.values())
    long = any("test_bombs" in test for test in record)
    summary = (
        f"{len(ROWS)} faults, {len(record):,} tests, {failed(record)} failed, {seconds:,.0f} s of tests; "
        f"{'with' if long else 'without'} the long loops. {platform.system()}, Python {platform.python_version()}, "
        f"{os.cpu_count()} cores."
    )
    lines = ["| fault | expected | injections, and their number | result |", "|---|---|---|---|"]
    lines += [line(row, record) for row in ROWS]
    return HEAD.format(summary=summary) + "\n" + "\n".join(lines) + "\n"


def line(row: Row, record: dict[str, Any]) -> str:
    """Return a row of the table."""
    tried: Counter[str] = Counter()
    bad: Counter[str] = Counter()
    n, wrong = 0, 0
    for test in row.tests:
        for node, kept in record.items():
            if not belongs(node, test):
                continue
            n += 1
            is_bad = kept["outcome"] != "passed"
            wrong += is_bad
            for what, times in kept["tried"] or [[words_of(node), 1]]:
                tried[what] += times
                bad[what] += is_bad
    cells = [
        what + (f": {times:,}" if times > 1 else "") + (f" ({bad[what]} failed)" if bad[what] else "")
        for what, times in tried.items()
    ]
    tests = f"{n} tests" if n != 1 else "1 test"
    result = f"**{wrong} of {tests} failed**" if wrong else f"{tests}, none failed" if n else "**not run**"
    return f"| {row.fault} | {row.expected} | {'<br>'.join(map(cell, cells))} | {result} |"


def words_of(node: str) -> str:
    """Return the name of a test without notes as words."""
    return node.split("::")[-1].partition("[")[0].removeprefix("test_").replace("_", " ")


def belongs(node: str, test: str) -> bool:
    """Return whether a test belongs to the file, class or function named in a row."""
    return node.startswith(test) and (test.endswith("::") or node[len(test) :][:1] in ("", "[", ":"))


def cell(text: str) -> str:
    """Escape text for a Markdown table."""
    for bad, good in (("|", "\\|"), ("<", "&lt;"), ("*", "\\*"), ("_", "\\_")):
        text = text.replace(bad, good)
    return text


if __name__ == "__main__":
    sys.exit(main())
