"""Exam of `rivid diagnose`: answer the seasons that have no result yet, and write docs/exam.md.

Usage: python -m benchmarks.exam [--seeds A:B] [--shard I/N] [--processes N] [--hours H] [--kept DIR]
                                 [--page FILE] [--page-only]
       python -m benchmarks.exam quick          short seasons; fails if a share is far from its target
       python -m benchmarks.exam draw SEED ...  the hidden effects of these seasons, one JSON object a line
       python -m benchmarks.exam sizes [A:B]    table of 1x of every effect in some worlds

Proof seeds begin at :data:`benchmarks.exam.worlds.FIRST_PROOF`. The seeds below, and each seed that has been
inspected, are for development. Results are stored in build/exam, one JSON object a line. A second call
continues where the first one was stopped. Remove a line or a file to answer its seasons again.
"""

import argparse
import itertools
import json
import sys
from collections.abc import Sequence
from pathlib import Path

from benchmarks.exam.page import PAGE, marked, page, targets
from benchmarks.exam.rows import ROWS
from benchmarks.exam.running import KEPT, outstanding, results_of, run, short
from benchmarks.exam.worlds import FIRST_PROOF, draw

PROOF = range(FIRST_PROOF, FIRST_PROOF + 1500)
"""Seeds of `make exam`. About 420 of them have nothing missing: if no name is given there, the upper limit of
the share is 0.009."""
QUICK_DAYS, QUICK_STEP = 30, 150.0
"""Days of the seasons of `quick`, and their shortest sample time [s]."""


def quick_seeds(many: int = 40) -> list[int]:
    """Return the seeds of `quick`. They are for development: they are inspected after every change."""
    slow = (seed for seed in itertools.count(5000) if draw(seed).scenario.reach.sample_time >= QUICK_STEP)
    return list(itertools.islice(slow, many))


def shard_of(text: str) -> tuple[int, int]:
    """Return the number of a shard, counted from 0, and the number of shards.

    Examples
    --------
    >>> shard_of("1/4")
    (1, 4)
    """
    mine, _, shards = text.partition("/")
    if not (mine.isdigit() and shards.isdigit() and int(mine) < int(shards)):
        raise argparse.ArgumentTypeError(f"{text!r}: expected I/N with I from 0 to N - 1, for example 0/2")
    return int(mine), int(shards)


def seeds_of(text: str) -> range:
    """Return the seeds from A to before B.

    Examples
    --------
    >>> seeds_of("10:13")
    range(10, 13)
    """
    first, _, end = text.partition(":")
    if not (first.isdigit() and end.isdigit() and int(first) < int(end)):
        raise argparse.ArgumentTypeError(f"{text!r}: expected A:B with A below B, for example 0:100")
    return range(int(first), int(end))


def options(words: Sequence[str]) -> argparse.Namespace:
    """Parse the command line of the exam without subcommand."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.exam", description=__doc__)
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.add_argument("--seeds", type=seeds_of, default=PROOF, help="A:B: from A to before B")
    parser.add_argument("--shard", type=shard_of, default=(0, 1), help="I/N: every N-th seed from I on")
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--hours", type=float, help="start no season after this time")
    parser.add_argument("--page-only", action="store_true", help="write the page from the stored results")
    parser.add_argument("--page", type=Path, default=PAGE, help="file of the page")
    parser.add_argument("--kept", type=Path, default=KEPT, help="folder of the results")
    return parser.parse_args(words)


def drawn(seeds: Sequence[str]) -> int:
    """Print the hidden effects of the seasons of some seeds."""
    from benchmarks.exam.hiding import plant

    for seed in seeds:
        print(json.dumps(plant(int(seed)).truth), flush=True)
    return 0


def sizes(words: Sequence[str]) -> int:
    """Print 1x of every effect."""
    from benchmarks.exam.hiding import table_of_units

    print(table_of_units(seeds_of(words[0] if words else "0:30")))
    return 0


def quick(kept: Path | None = None) -> int:
    """Answer short seasons for development; return 1 if a share is far from its target."""
    from tempfile import TemporaryDirectory

    with TemporaryDirectory() as scratch:
        place = Path(scratch) if kept is None else kept
        run(quick_seeds(), kept=place, desks=short(QUICK_DAYS), report=lambda text: print(text, flush=True))
        judged = [j for _, j in marked(results_of(place))]
    print(targets(judged))
    failed = [f"{asked.group}: {asked.words}" for asked in ROWS if asked.refused(judged)]
    for words in failed:
        print(f"FAILED: {words}")
    return int(bool(failed))


def main(words: Sequence[str] | None = None) -> int:
    """Answer the outstanding seasons, and write the page."""
    given = list(sys.argv[1:] if words is None else words)
    if given and given[0] in ("draw", "sizes"):
        return (drawn if given[0] == "draw" else sizes)(given[1:])
    if given == ["quick"]:
        return quick()
    asked = options(given)
    if not asked.page_only and outstanding(asked.seeds, asked.shard, asked.kept):
        run(
            asked.seeds, shard=asked.shard, processes=asked.processes, hours=asked.hours, kept=asked.kept,
            report=lambda text: print(text, flush=True),
        )  # fmt: skip
    wanted = set(asked.seeds)
    asked.page.write_text(page([r for r in results_of(asked.kept) if r["seed"] in wanted]), encoding="utf-8")
    print(f"written: {asked.page}")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
