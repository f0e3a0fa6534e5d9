"""Run the reaches of a fleet, each whole in one worker; a large one that is left over is shared out by days.

A fault in one reach is part of its outcome and does not stop the others. This process holds outcomes only.
"""

import traceback
from collections.abc import Iterator, Sequence
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path

from rivid.errors import ConfigError, RividError, printable
from rivid.fleet.layout import NAME, Reach
from rivid.fleet.outcome import FOLDER, Outcome, keep, kept, outcome_of
from rivid.logs.spec import shown
from rivid.results.read import last_record
from rivid.results.store import Store
from rivid.run.run import ONE_PROCESS_BELOW, Options, TooManyError, run
from rivid.run.workers import DRAWING, ESTIMATING, Engine, Progress, cores, each, processes

SHARED_ABOVE = 4 * ONE_PROCESS_BELOW
"""New days from which a reach is shared out, where workers would otherwise be idle."""


def run_fleet(
    data_dir: Path,
    reaches: Sequence[Reach],
    out: Path,
    options: Options,
    progress: Progress,
    engine: Engine | None,
) -> Iterator[Outcome]:
    """Run every reach into OUT/<reach>, store its outcome, and yield it as the reach finishes.

    With a shard, every N-th reach is run, whole. `progress` counts reaches. The default engine has as many
    processes as there are cores, and reaches to run. ConfigError if OUT is inside DATA_DIR or the reverse;
    LockedError if another run of the fleet holds OUT.
    """
    logs, results = data_dir.resolve(), out.resolve()
    if logs == results or logs in results.parents or results in logs.parents:
        raise ConfigError(
            f"OUT ({out}) and DATA_DIR ({data_dir}) lie in each other: results would be taken for reaches; "
            "give another --out"
        )
    shard = options.shard
    if shard:
        reaches = reaches[shard.index - 1 :: shard.count]
    options = replace(options, shard=None)
    with Store(out, shard.name if shard else ""):
        if not shard:
            gone = {old.reach for old in kept(out)} - {reach.name for reach in reaches}
            for name in gone:  # their results stay
                (out / FOLDER / f"{name}.json").unlink(missing_ok=True)
        workers = min(options.workers or cores(), max(len(reaches), 1))
        modules = [*ESTIMATING, "rivid.fleet.run", *(DRAWING if options.figures else ())]
        with progress(len(reaches)) if reaches else nullcontext(lambda _: None) as done:
            with nullcontext(engine) if engine else processes(workers, modules) as executing:
                for outcome in _run(reaches, out, options, executing):
                    done(1)
                    yield outcome


def _run(reaches: Sequence[Reach], root: Path, options: Options, engine: Engine) -> Iterator[Outcome]:
    """Outcomes as they finish."""
    left_over = []
    last = len(reaches) - engine.slots if engine.slots > 1 else len(reaches)
    tasks = ((run_reach, reach, root, options, place > last) for place, reach in enumerate(reaches))
    for (_, reach, *_), outcome, lost in each(tasks, engine):
        if lost:  # one of the reaches under way killed its worker: each again, in a worker of its own
            with engine.one() as single:
                outcome = run_reach(reach, root, options, engine=single)
        if outcome is None:
            left_over.append(reach)
        else:
            yield outcome
    for reach in left_over:
        outcome = run_reach(reach, root, options, engine=engine)
        assert outcome is not None  # it may not decline
        yield outcome


def run_reach(
    reach: Reach, root: Path, options: Options, may_decline: bool = False, engine: Engine | None = None
) -> Outcome | None:
    """Run one reach into root/<reach>, by default in this process; any error becomes part of its outcome.

    With `may_decline`, None for a reach of more than :data:`SHARED_ABOVE` new days: it is to be shared out.
    """
    out = root / reach.name
    if may_decline:
        options = replace(options, most_new=SHARED_ABOVE)
    try:
        config = reach.config()
        summary = run(reach.data_dir, out, config, options, None, engine or Engine())
        outcome = outcome_of(reach.name, config, summary, str(last_record(out).get("content") or ""))
    except TooManyError:
        return None
    except RividError as error:
        outcome = Outcome(shown(reach.name), error.exit_code, printable(" ".join(str(error).split())))
    except Exception as error:  # an internal error in one reach must not stop the others
        traceback.print_exc()
        outcome = Outcome(shown(reach.name), 1, f"{type(error).__name__}: {error}"[:500])
    if NAME.fullmatch(reach.name):
        keep(root, outcome)
    return outcome
