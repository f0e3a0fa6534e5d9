"""Free runs of rows that may fail: where much is missing, a pool without a nudge runs dry within a day."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from rivid.diagnosis.data import Record
from rivid.errors import RividError
from rivid.reach.changes import Changes
from rivid.types import Floats

Run = Callable[[Record, Changes], Floats]


def as_far_as_it_goes(run: Run, record: Record, changes: Changes) -> Floats:
    """All rows of a run, each until the water cannot follow the logs.

    Parameters
    ----------
    run : callable
        Record and changes to an output (days, n); rows know nothing of each other. It raises RividError
        where any row fails.
    record : Record
    changes : Changes

    Returns
    -------
    ndarray, shape (days, n)
        NaN after the last sample that a row can be simulated to.
    """
    try:
        return run(record, changes)
    except RividError:
        pass
    output = np.full(record.time.shape, np.nan)
    for row in range(record.days):
        done, failed = 0, record.time.shape[1] + 1
        end = failed - 1  # most rows go all the way
        while failed - done > 1:
            try:
                output[row, :end] = run(*part_of(record, changes, row, end))[0]
                done = end
            except RividError:
                failed = end
            end = (done + failed) // 2
    return output


def part_of(record: Record, changes: Changes, row: int, n: int) -> tuple[Record, Changes]:
    """The first n samples of a row, and what changes on them."""
    shape = record.time.shape

    def cut(values: Floats) -> Floats:
        return np.broadcast_to(values, shape)[row : row + 1, :n]

    gate = changes.gate
    part = replace(
        record, dates=record.dates[row : row + 1], time=cut(record.time), inflow=cut(record.inflow),
        outflow=cut(record.outflow), output=cut(record.output), used=record.used[row : row + 1, :n],
    )  # fmt: skip
    return part, replace(
        changes,
        inflow=None if changes.inflow is None else cut(changes.inflow),
        gate=replace(
            gate, dead_band=cut(gate.dead_band), rate=cut(gate.rate), lag=cut(gate.lag),
            factor=cut(gate.factor), head=cut(gate.head),
        ),
        added=tuple(replace(each, flow=cut(each.flow)) for each in changes.added),
        leaks=tuple(replace(each, loss=cut(each.loss)) for each in changes.leaks),
        ponds=tuple(replace(each, exchange=cut(each.exchange)) for each in changes.ponds),
        gauge=cut(changes.gauge),
    )  # fmt: skip
