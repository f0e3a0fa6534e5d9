"""Write or compare the golden values: ``python -m tests.golden.make [--compare] [part ...]``."""

import gzip
import json
import sys
import tempfile
from pathlib import Path

import numpy as np

from tests.golden import cases

HERE = Path(__file__).parent
PARTS = {
    "runs": cases.runs,
    "corpus": cases.corpus,
    "checks": cases.checks,
    "diagnoses": cases.diagnoses,
}


def plain(value):
    """Return a value as JSON stores it."""
    if isinstance(value, dict) and value and all(isinstance(v, np.ndarray) for v in value.values()):
        return {k: [None if v != v else v for v in column.tolist()] for k, column in value.items()}
    return value


def made(part):
    with tempfile.TemporaryDirectory() as folder:
        return {name: json.loads(json.dumps(plain(v), default=str)) for name, v in PARTS[part](Path(folder))}


def expected(part):
    return json.loads(gzip.decompress((HERE / f"{part}.json.gz").read_bytes()))


def main(words):
    compare = "--compare" in words
    for part in [word for word in words if word in PARTS] or PARTS:
        found = made(part)
        if compare:
            wrong = cases.differences(found, expected(part), part)
            print(part, "the same" if not wrong else "\n  ".join([f"{len(wrong)} differ:", *wrong[:40]]))
        else:
            text = json.dumps(found, sort_keys=True).encode()
            (HERE / f"{part}.json.gz").write_bytes(gzip.compress(text, mtime=0))
            print(part, len(found), "values")


if __name__ == "__main__":
    main(sys.argv[1:])
