"""The exam of `rivid diagnose`: what is not asked yet is asked, and docs/exam.md is written.

Usage: python -m benchmarks.exam [--only NAME ...] [--share 0.5] [--shard I/N] [--processes N] [--hours H]
                                 [--quick] [--page-only] [--list]
       python -m benchmarks.exam draw SEED ...

Results are kept in build/exam, a file for each case and seed: a second call goes on where the first was
stopped. Remove a file, or the folder of a case, to ask it again.
"""

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path

from benchmarks.exam.cases import tasks
from benchmarks.exam.page import PAGE, marked, page, targets
from benchmarks.exam.running import KEPT, outstanding, results_of, run


def shard_of(text: str) -> tuple[int, int]:
    """Number of a shard, from 0, and of how many.

    Examples
    --------
    >>> shard_of("1/4")
    (1, 4)
    """
    mine, _, shards = text.partition("/")
    if not (mine.isdigit() and shards.isdigit() and int(mine) < int(shards)):
        raise argparse.ArgumentTypeError(f"{text!r}: expected I/N with I from 0 to N - 1, for example 0/2")
    return int(mine), int(shards)


def options(words: Sequence[str] | None = None) -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.exam", description=__doc__)
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.add_argument("--only", nargs="*", default=[], help="cases whose name holds this, or rows")
    parser.add_argument("--share", type=float, default=1.0, help="of the seeds")
    parser.add_argument("--shard", type=shard_of, default=(0, 1), help="I/N: every N-th case from I on")
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--hours", type=float, default=8.0, help="no case is begun later")
    parser.add_argument("--quick", action="store_true", help="one seed of a few cases; the page stays")
    parser.add_argument("--page-only", action="store_true", help="write the page from what is there")
    parser.add_argument("--list", action="store_true", help="what is outstanding, and do nothing")
    parser.add_argument("--kept", type=Path, default=KEPT, help="where results are kept")
    return parser.parse_args(words)


def drawn(seeds: Sequence[str]) -> None:
    """Print what is hidden in the seasons of some seeds, a line of JSON each."""
    from benchmarks.exam.hiding import plant

    for seed in seeds:
        print(json.dumps(plant(int(seed)).truth), flush=True)


def main(words: Sequence[str] | None = None) -> None:
    """Ask what is outstanding, and write the page."""
    given = list(sys.argv[1:] if words is None else words)
    if given[:1] == ["draw"]:
        return drawn(given[1:])
    said = options(words)
    wanted = tasks(said.only, quick=said.quick, share=said.share)
    todo = outstanding(wanted, said.shard, said.kept)
    if said.list:
        for case, seed in todo:
            print(f"{case.name} {seed}")
        return
    if todo and not said.page_only:
        run(
            todo, processes=said.processes, hours=said.hours, kept=said.kept,
            report=lambda text: print(text, flush=True),
        )  # fmt: skip
    if said.quick:
        print(targets(marked(results_of(wanted, said.kept))))
        return
    PAGE.write_text(page(results_of(tasks(), said.kept)), encoding="utf-8")
    print(f"written: {PAGE}")


if __name__ == "__main__":
    main()
