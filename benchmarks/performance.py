"""Measure speed and memory: medians of ratios measured side by side in one run; write docs/performance.md.

Usage: python -m benchmarks.performance [--quick] [--only PART ...]
"""

import argparse
import datetime as dt
import json
import os
import shutil
import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from benchmarks import diagnosis
from benchmarks.generator import write_reach
from benchmarks.measure import PYTHON, Usage, functions_in_turn, in_turn, machine, median, process, table
from benchmarks.saint_venant import sections
from rivid.core.fir import condition_numbers, gram, jmap
from rivid.logs.write import write_days
from rivid.simulation import Season, simulate
from rivid.simulation.scenario import load_scenario
from tests.core.transcription import table_vi

ROOT = Path(__file__).parent.parent
CONFIG = ROOT / "configs" / "basse_isere.toml"


def core(season: Season) -> str:
    """Compare the fast estimator with the plain transcription of Table VI."""
    u = season.inflow[:, :649] - season.inflow[:, :1]
    y = season.level[:, :649] - season.level[:, :1]
    few = slice(0, 40)

    def plain(days: slice = few) -> list[float]:
        return [table_vi(a, b, 30, range(1, 16))[0] for a, b in zip(u[days], y[days], strict=True)]

    A = np.empty((30, 31, 192))
    gram(u, y, np.arange(192), A[:, :-1], A[:, -1])
    seconds = functions_in_turn(
        {"plain": plain, "fast": lambda: jmap(u, y), "condition": lambda: condition_numbers(A[:, :-1])},
        runs=9,
    )
    slow = [s / 40 * 1e6 for s in seconds["plain"]]
    quick = [s / len(u) * 1e6 for s in seconds["fast"]]
    condition = median(seconds["condition"]) / 192 * 1e6
    ratio = median([a / b for a, b in zip(slow, quick, strict=True)])
    alone = median([a / (b - condition) for a, b in zip(slow, quick, strict=True)])
    same = int(np.sum(np.array(plain(slice(None))) == jmap(u, y).delay))
    one = median(functions_in_turn({"one": lambda: jmap(u[0], y[0])}, runs=20)["one"]) * 1e3
    rows = [
        ["Table VI, plain transcription, U'U once a day", f"{median(slow):.0f} us a day", "1"],
        ["`jmap`, 332 days in one call", f"{median(quick):.0f} us a day", f"{ratio:.1f}"],
        ["of which condition numbers, not in the plain one", f"{condition:.0f} us a day", ""],
        ["`jmap` less condition numbers", f"{median(quick) - condition:.0f} us a day", f"{alone:.1f}"],
        ["`jmap`, a single day", f"{one:.1f} ms", ""],
    ]
    text = "## The estimator, one core\n\nM = 30, 15 candidate delays, N = 649.\n\n"
    text += table(["what", "time", "times the plain one"], rows)
    return text + f"\nThe same delay on {same} of {len(u)} days.\n"


STARTING = "import rivid.cli, rivid.cli.run, rivid.config, rivid.run.run, rivid.run.workers; rivid.run.workers.without_pandas()"
"""Imports of `rivid run` before it reads its first file."""


def year(season: Season, work: Path, runs: int) -> str:
    """Compare a year of CSV days, end to end, with the minimum of such a run."""
    data = work / "year"
    write(season, data, 1)
    out = work / "out"
    commands = {
        "floor": [PYTHON, "-m", "benchmarks.floor", str(data), str(work / "floor.png")],
        "run": _run(data, out),
        "jmap": [*_run(data, out), "--estimator", "jmap"],
        "five": [*_run(data, out), "--config", str(CONFIG)],
        "tables": [*_run(data, out), "--no-figures"],
    }
    usages = in_turn(commands, runs, lambda _: shutil.rmtree(out, ignore_errors=True))
    process(commands["run"])
    again = in_turn({"again": commands["run"]}, runs, lambda _: None)["again"]
    floor = usages["floor"]
    names = {
        "floor": "floor: same libraries, same files, one figure",
        "run": "`rivid run`: jmap and posterior, tables, figures, report",
        "jmap": "`rivid run --estimator jmap`",
        "five": "`rivid run`: jmap, posterior, jmap-uniform, map, ml",
        "tables": "`rivid run --no-figures`",
        "again": "`rivid run` again, nothing new",
    }
    rows = []
    for key, used in (usages | {"again": again}).items():
        ratio = median([a.seconds / b.seconds for a, b in zip(used, floor, strict=True)])
        rows.append(
            [names[key], f"{median([u.seconds for u in used]):.2f} s", f"{ratio:.2f}",
             f"{median([u.cpu for u in used]):.2f} s", f"{median([u.peak_mb for u in used]):.0f} MB"]
        )  # fmt: skip
    text = f"## A year of CSV days ({len(season.dates)} files), end to end\n\n"
    head = ["what", "wall time", "times the floor", "processor time", "largest process"]
    text += table(head, rows) + "\nFigures are drawn by separate processes, each on a core of its own "
    text += "if one is free: they add processor time and save wall time.\n\n"
    return text + every_day(data, work, runs)


def every_day(data: Path, work: Path, runs: int) -> str:
    """Compare one new day in a finished year with the start-up of Python and the imports."""
    out, finished = work / "daily", work / "finished"
    last = max(data.glob("*.csv"))
    aside = work / "last.csv"
    shutil.move(last, aside)
    run = [*_run(data, out), "--no-figures"]
    process(run)
    shutil.copytree(out, finished)

    def before(name: str) -> None:
        shutil.rmtree(out)
        shutil.copytree(finished, out)
        if name == "day":
            shutil.copy(aside, last)
        else:
            last.unlink(missing_ok=True)

    commands = {
        "start": [PYTHON, "-c", STARTING],
        "day": run,
        "nothing": run,
        "help": [PYTHON, "-m", "rivid", "--help"],
    }
    usages = in_turn(commands, runs, before)
    names = {
        "start": "start-up: Python, and the imports of `rivid run`",
        "day": "`rivid run --no-figures`, one new day",
        "nothing": "`rivid run --no-figures`, nothing new",
        "help": "`rivid --help`",
    }
    rows = []
    for key, used in usages.items():
        ratio = median([a.seconds / b.seconds for a, b in zip(used, usages["start"], strict=True)])
        rows.append([names[key], f"{median([u.seconds for u in used]) * 1e3:.0f} ms", f"{ratio:.2f}"])
    return "### Every morning\n\n" + table(["what", "wall time", "times the start-up"], rows)


def scale(season: Season, work: Path, years: list[int]) -> str:
    """Measure days per second and memory as the record grows: tables without figures, two workers."""
    rows = []
    for n in years:
        data, out = work / f"years{n}", work / f"out{n}"
        write(season, data, n)
        used = process([*_tables(data, out), "--workers", "2"])
        rows.append(_scaled(f"{n * len(season.dates):,}", n * len(season.dates), used))
        shutil.rmtree(data)
        shutil.rmtree(out)
    text = "## As the record grows\n\nCSV days, `jmap`, two workers, tables without figures.\n\n"
    return text + table(["days", "wall time", "days a second", "the command itself", "largest process"], rows)


def fleet(season: Season, work: Path, reaches: list[int]) -> str:
    """Measure days per second and memory as the number of reaches grows, each with a year of CSV days."""
    rows = []
    for n in reaches:
        data, out = work / f"fleet{n}", work / f"out{n}"
        write(season, data / "r0", 1)
        for k in range(1, n):
            shutil.copytree(data / "r0", data / f"r{k}", copy_function=os.link)
        days = n * len(season.dates)
        command = [*_tables(data, out), "--workers", "2"]
        rows.append([f"{n:,}", *_scaled(f"{days:,}", days, process(command))])
        rows.append([f"{n:,}, again, nothing new", *_scaled(f"{days:,}", days, process(command))])
        shutil.rmtree(data)
        shutil.rmtree(out)
    text = "## As the fleet grows\n\nLarger ones: [scale.md](scale.md). A year of CSV days a reach, `jmap`, two workers, tables without figures.\n\n"
    head = ["reaches", "days", "wall time", "days a second", "the command itself", "largest process"]
    return text + table(head, rows)


DASK = """
import atexit, json, pathlib, sys, time
from rivid.cli import main
from rivid.run.dask import Dask
place, took = pathlib.Path(sys.argv.pop(1)), []
def timed(function):
    def call(*given, **named):
        began = time.perf_counter()
        try:
            return function(*given, **named)
        finally:
            took.append(time.perf_counter() - began)
    return call
Dask._begin, Dask._close = timed(Dask._begin), timed(Dask._close)
atexit.register(lambda: place.write_text(json.dumps([sum(took[:-1]), took[-1]])))
main()
"""
"""Program `rivid` that writes the start and stop times of its cluster [s] to a file."""


def engines(season: Season, work: Path, days: int, runs: int) -> str:
    """Compare Dask with processes, both with two workers: one reach, Parquet logs."""
    data, out, cluster = work / "engines", work / "engines_out", work / "cluster.json"
    ends: list[tuple[float, float]] = []
    write_reach((season.inflow, season.outflow, season.level), season.sample_time, data, 1, days, "parquet")
    run = [*_tables(data, out), "--workers", "2"]
    commands = {"processes": run, "dask": [PYTHON, "-c", DASK, str(cluster), *run[3:], "--engine", "dask"]}

    def before(_: str) -> None:
        shutil.rmtree(out, ignore_errors=True)
        if cluster.exists():
            ends.append(json.loads(cluster.read_text(encoding="utf-8")))
            cluster.unlink()

    usages = in_turn(commands, runs, before)
    before("")
    usages["dask, start and end of the cluster aside"] = [
        replace(used, seconds=used.seconds - sum(both))
        for used, both in zip(usages["dask"], ends[1:], strict=True)
    ]
    shutil.rmtree(data)
    rows = []
    for name, used in usages.items():
        ratio = median([a.seconds / b.seconds for a, b in zip(used, usages["processes"], strict=True)])
        memory = [f"{max(u.own_mb for u in used):.0f} MB", f"{max(u.peak_mb for u in used):.0f} MB"]
        rows.append([name, f"{median([u.seconds for u in used]):.1f} s", f"{ratio:.2f}", *memory])
    head = ["engine", "wall time", "times processes", "the command itself", "largest process"]
    text = f"## Dask and processes, {days:,} days\n\nParquet logs of one reach, `jmap`, two workers, tables "
    start, end = (median(seconds) for seconds in zip(*ends[1:], strict=True))
    text += f"without figures. The tables are identical. The cluster starts in {start:.1f} s, imports "
    text += f"included, and stops in {end:.1f} s. Goal without these: 1.05 times processes.\n\n"
    return text + table(head, rows)


def _run(data: Path, out: Path) -> list[str]:
    return [PYTHON, "-m", "rivid", "run", str(data), "--out", str(out), "-q"]


def _tables(data: Path, out: Path) -> list[str]:
    return [*_run(data, out), "--no-figures", "--estimator", "jmap"]


def _scaled(name: str, days: int, used: Usage) -> list[str]:
    memory = [f"{used.own_mb:.0f} MB", f"{used.peak_mb:.0f} MB"]
    return [name, f"{used.seconds:.1f} s", f"{days / used.seconds:.0f}", *memory]


def write(season: Season, data: Path, years: int) -> None:
    """Write the season's days as CSV, repeated from 1900 on, with another flow each year."""
    data.mkdir(parents=True)
    date = dt.date(1900, 1, 1)
    for year in range(years):
        for i in range(len(season.dates)):
            columns = {
                "u_Qi": season.inflow[i] + year,
                "u_Qo": season.outflow[i] + year,
                "h_L": season.level[i],
            }
            write_days(
                data,
                [(date, columns)],
                sample_time=season.sample_time,
                offset=dt.timedelta(hours=1),
            )
            date += dt.timedelta(days=1)


PARTS: dict[str, Callable[[Season, Path, bool], str]] = {
    "core": lambda season, work, quick: core(season),
    "year": lambda season, work, quick: year(season, work, 2 if quick else 7),
    "scale": lambda season, work, quick: scale(season, work, [1, 2] if quick else [1, 10, 100]),
    "fleet": lambda season, work, quick: fleet(season, work, [2] if quick else [3, 30, 100]),
    "engines": lambda season, work, quick: engines(season, work, *((500, 1) if quick else (20_000, 3))),
    "water": lambda season, work, quick: sections(),
    "diagnosis": lambda season, work, quick: diagnosis.section(work, quick),
}
"""Sections of the page."""


def main() -> None:
    """Run all or some parts, print them, and write docs/performance.md."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--quick", action="store_true", help="fewer and shorter runs, no page")
    parser.add_argument("--only", nargs="+", choices=PARTS, help="print these parts, no page")
    given = parser.parse_args()
    quick = given.quick
    threadpool_limits(1)
    season = simulate(load_scenario(ROOT / "configs" / "scenarios" / "basse_isere.toml"), seed=1)
    with tempfile.TemporaryDirectory() as directory:
        parts = [PARTS[name](season, Path(directory), quick) for name in given.only or PARTS]
    text = (
        "# Performance\n\nWritten by `make bench`. Ratios are medians of pairs measured in turn in one run; "
        f"absolute times are of this machine: {machine()}, numpy {np.__version__}.\n\n" + "\n".join(parts)
    )
    print(text)
    if not quick and not given.only:
        (ROOT / "docs" / "performance.md").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
