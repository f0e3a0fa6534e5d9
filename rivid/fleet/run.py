"""Run the reaches of a fleet, each whole in one worker; a large one that is left over is shared out by days.

No reach waits for another, and what one of them lacks is its own outcome. This process holds outcomes only.
"""

import traceback
from collections.abc import Callable, Iterator, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from rivid.errors import ConfigError, NoDataError, RividError, printable
from rivid.fleet.layout import NAME, Reach
from rivid.fleet.outcome import Outcome, forget, keep, kept, outcome_of
from rivid.logs.files import shown
from rivid.results import record
from rivid.results.store import Store
from rivid.run.drawing import forget_results
from rivid.run.plan import Options
from rivid.run.run import ONE_PROCESS_BELOW, TooManyError, run
from rivid.run.workers import DRAWING, ESTIMATING, Engine, Here, cores, each, processes

SHARED_ABOVE = 4 * ONE_PROCESS_BELOW
"""A reach with more new days than this is shared out, where workers would otherwise wait for it."""


@dataclass(frozen=True)
class Task:
    """A reach to run, with all it needs.

    Parameters
    ----------
    reach : Reach
    root, out : Path
        OUT of the fleet and of the reach.
    options : Options
    """

    reach: Reach
    root: Path
    out: Path
    options: Options


def run_fleet(
    data_dir: Path,
    reaches: Sequence[Reach],
    out: Path,
    options: Options,
    progress: Any = None,
    engine: Engine | None = None,
    tell: Callable[[Outcome], None] = lambda _: None,
) -> list[Outcome]:
    """Run every reach, and keep what came of each.

    Parameters
    ----------
    data_dir : Path
    reaches : sequence of Reach
        As of :func:`rivid.fleet.layout.find_fleet`.
    out : Path
        Results of a reach go to its directory there.
    options : Options
        Of a shard, every N-th reach is run, whole.
    progress : callable, optional
        As of :func:`rivid.run.run.run`; it counts reaches.
    engine : Engine, optional
        By default as many processes as there are cores, and reaches to run.
    tell : callable, optional
        Called with each outcome when it is known.

    Returns
    -------
    list of Outcome
        Of the reaches that were run, by name.

    Raises
    ------
    ConfigError
        Where OUT and DATA_DIR lie in each other.
    LockedError
        Where another run of the fleet holds OUT.
    """
    _refuse_places(data_dir, out)
    shard = options.shard
    if shard:
        reaches = [reach for place, reach in enumerate(reaches) if shard.holds_place(place)]
    options = replace(options, shard=None)
    with Store(out, shard.name if shard else ""):
        if not shard:
            present = {reach.name for reach in reaches}
            forget(out, [old.reach for old in kept(out) if old.reach not in present])
        tasks = [Task(reach, out, out / reach.name, options) for reach in reaches]
        workers = engine.slots if engine else min(options.workers or cores(), max(len(tasks), 1))
        modules = [*ESTIMATING, "rivid.fleet.run", *(DRAWING if options.figures else ())]
        outcomes = []
        with progress(len(tasks)) if progress and tasks else nullcontext(lambda _: None) as done:
            with nullcontext(engine) if engine else processes(workers, modules) as executing:
                for outcome in _run(tasks, executing):
                    outcomes.append(outcome)
                    tell(outcome)
                    done(1)
    return sorted(outcomes, key=lambda outcome: outcome.reach)


def _refuse_places(data_dir: Path, out: Path) -> None:
    logs, results = data_dir.resolve(), out.resolve()
    if logs == results or logs in results.parents or results in logs.parents:
        raise ConfigError(
            f"OUT ({out}) and DATA_DIR ({data_dir}) lie in each other: results would be taken for reaches; "
            "give another --out"
        )


def _run(tasks: Sequence[Task], engine: Engine) -> Iterator[Outcome]:
    """Outcomes as they come."""
    left_over = []
    last = (1 < engine.slots and len(tasks) - place < engine.slots for place in range(len(tasks)))
    for (_, task, _), outcome, lost in each(
        ((run_reach, task, is_last) for task, is_last in zip(tasks, last, strict=True)), engine
    ):
        if lost:  # one of those under way killed its worker: each again, by itself
            with engine.one() as single:
                outcome = run_reach(task, engine=single)
        if outcome is None:
            left_over.append(task)
        else:
            yield outcome
    for task in left_over:
        outcome = run_reach(task, engine=engine)
        assert outcome is not None  # it may not decline
        yield outcome


def run_reach(task: Task, may_decline: bool = False, engine: Engine | None = None) -> Outcome | None:
    """Run one reach, whatever is wrong with it.

    Parameters
    ----------
    task : Task
    may_decline : bool
        Give None for a reach of more than :data:`SHARED_ABOVE` new days: it is to be shared out.
    engine : Engine, optional
        By default this process.

    Returns
    -------
    Outcome or None
    """
    reach, options = task.reach, task.options
    if may_decline:
        options = replace(options, most_new=SHARED_ABOVE)
    try:
        config = reach.config()
        summary = run(reach.data_dir, task.out, config, options, None, engine or Here())
        content = str(record.last(task.out).get("content") or "")
        outcome = outcome_of(reach.name, config, summary, content)
    except TooManyError:
        return None
    except RividError as error:
        outcome = Outcome(shown(reach.name), error.exit_code, printable(" ".join(str(error).split())))
    except Exception as error:  # a fault of ours in one reach must not cost the others
        traceback.print_exc()
        outcome = Outcome(shown(reach.name), 1, f"{type(error).__name__}: {error}"[:500])
    finally:
        forget_results()
    if NAME.fullmatch(reach.name):
        keep(task.root, outcome)
    return outcome


def fleet_of(out: Path) -> list[Outcome]:
    """All outcomes that are kept under OUT.

    Raises
    ------
    NoDataError
        Where there is none.
    """
    outcomes = kept(out)
    if not outcomes:
        raise NoDataError(f"{out} holds no results of a fleet: run `rivid run DATA_DIR --out {out}` first")
    return outcomes
