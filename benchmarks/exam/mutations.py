"""Remove parts of the diagnosis one at a time: the exam must fail each time.

The short seasons of `python -m benchmarks.exam quick` are answered under each mutation. If no share is
refused under a mutation, either the removed part is not needed or the exam does not test it.

Usage: python -m benchmarks.exam.mutations [--only MUTATION ...] [--seeds A:B]
"""

import argparse
import contextlib
import importlib
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from unittest.mock import patch

from benchmarks.exam.__main__ import QUICK_DAYS, quick_seeds, seeds_of
from benchmarks.exam.answering import Logs, answer
from benchmarks.exam.naive import named_by_regression
from benchmarks.exam.page import marked
from benchmarks.exam.rows import ROWS
from benchmarks.exam.running import Desks, results_of, run, short
from benchmarks.measure import table

WORKFLOW = "rivid.diagnosis.workflow.diagnose"
"""Replaced by the regression."""
MATERIAL = "rivid.diagnosis.decision.is_material"
"""Decides whether an explanation is material: (one, other, ...) to bool."""
LATENT = "rivid.diagnosis.workflow._Search._with_unknown"
"""Adds the explanations without a name, a flow and an error of the gauge: (search, parent) to parent and the
added explanations."""
BLOCKS = "rivid.diagnosis.blocks.split"
"""Divides days into blocks: (days, block_days) to Split. It is patched in every module that imports it."""
Mutation = Callable[[], contextlib.AbstractContextManager[Any]]


def as_it_is() -> contextlib.AbstractContextManager[Any]:
    """Remove nothing."""
    return contextlib.nullcontext()


def regression() -> contextlib.AbstractContextManager[Any]:
    """Replace the whole search by least squares of the level differences."""
    return patch(WORKFLOW, named_by_regression)


def all_material() -> contextlib.AbstractContextManager[Any]:
    """Regard every explanation as material, so that significant effects are named whatever their size."""
    return patch(MATERIAL, lambda *_, **__: True)


def no_latent() -> contextlib.AbstractContextManager[Any]:
    """Remove the explanations without a name."""
    return patch(LATENT, lambda _, parent: (parent, []))


@contextlib.contextmanager
def days_for_blocks() -> Iterator[None]:
    """Assign, leave out and resample single days instead of blocks."""
    from rivid.diagnosis import blocks

    split = blocks.split
    with contextlib.ExitStack() as stack:
        for place in importers(BLOCKS):
            stack.enter_context(patch(place, lambda days, *_, **__: split(days, 1)))
        yield


def importers(target: str) -> list[str]:
    """Return all names in `rivid.diagnosis` under which a function is imported, the target included."""
    module, _, name = target.rpartition(".")
    function = getattr(importlib.import_module(module), name)
    found = []
    root = Path(importlib.import_module("rivid.diagnosis").__file__ or "").parent
    for place in sorted(root.rglob("*.py")):
        words = ["rivid", "diagnosis", *place.relative_to(root).with_suffix("").parts]
        full = ".".join(word for word in words if word != "__init__")
        if getattr(importlib.import_module(full), name, None) is function:
            found.append(f"{full}.{name}")
    return found


MUTATIONS: dict[str, Mutation] = {
    "as it is": as_it_is,
    "naive regression of the differenced level": regression,
    "no materiality": all_material,
    "no latent explanation": no_latent,
    "days instead of blocks": days_for_blocks,
}


def answered(logs: Logs, mutation: str) -> dict[str, Any]:
    """Diagnose with a part removed; runs in a process of its own."""
    with MUTATIONS[mutation]():
        return answer(logs)


def failing(mutation: str, seeds: Sequence[int]) -> list[str]:
    """Return the shares that are refused under a mutation."""
    desks = Desks(short(QUICK_DAYS).plant, partial(answered, mutation=mutation), no_floor)
    with TemporaryDirectory() as scratch:
        run(
            seeds,
            kept=Path(scratch),
            desks=desks,
            report=lambda text: print(f"{mutation}: {text}", flush=True),
        )
        results = results_of(Path(scratch))
    crashed = [str(one["answer"]["error"]) for one in results if "error" in one["answer"]]
    if crashed:  # the exam would refuse the failures, which shows nothing about the removed part
        raise RuntimeError(f"{mutation}: {len(crashed)} of {len(results)} diagnoses failed: {crashed[0]}")
    judged = [j for _, j in marked(results)]
    return [
        f"{asked.group}: {asked.words} {hits}/{n}"
        for asked in ROWS
        if asked.refused(judged)
        for hits, n in [asked.counted(judged)]
    ]


def no_floor(*_: Any) -> None:
    """Skip the model that knows the truth: the closed gap is not evaluated."""


def table_of(found: dict[str, list[str]]) -> str:
    """Return the table of mutations with the refused shares."""
    lines = []
    for mutation, failed in found.items():
        good = bool(failed) != (mutation == "as it is")
        verdict = "as it must be" if good else "NOT NOTICED" if mutation != "as it is" else "DOES NOT PASS"
        lines.append([mutation, "; ".join(failed) or "none", verdict])
    return table(["mutation", "shares that are refused", "the exam"], lines)


def noticed(found: dict[str, list[str]]) -> bool:
    """Return whether nothing is refused without a mutation, and something under every mutation.

    Examples
    --------
    >>> noticed({"as it is": [], "no materiality": ["nothing missing: any name 9/12"]})
    True
    >>> noticed({"as it is": [], "no materiality": []})
    False
    """
    return all(bool(failed) != (mutation == "as it is") for mutation, failed in found.items())


def main(words: Sequence[str] | None = None) -> None:
    """Answer the short seasons under each mutation, and print the table."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.exam.mutations", description=__doc__)
    parser.add_argument("--only", nargs="*", default=[], help="mutations with this in their name")
    parser.add_argument("--seeds", type=seeds_of, help="A:B; default: the seeds of `quick`")
    given = parser.parse_args(words)
    chosen = [m for m in MUTATIONS if not given.only or any(part in m for part in given.only)]
    found = {mutation: failing(mutation, given.seeds or quick_seeds()) for mutation in chosen}
    print(table_of(found))
    if not noticed(found):
        raise SystemExit(1)


if __name__ == "__main__":
    main()
