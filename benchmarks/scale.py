"""Measure a large fleet: 100,000 and 1,000,000 days with `rivid run` on two cores; write docs/scale.md.

Usage: python -m benchmarks.scale [--quick] [--work DIR]
"""

import argparse
import datetime as dt
import json
import shutil
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.generator import write_fleet, write_reach
from benchmarks.measure import PYTHON, Usage, machine, median, process, table
from rivid.simulation import Season, simulate
from rivid.simulation.scenario import load_scenario

ROOT = Path(__file__).parent.parent
FOUR = [word for name in ("ml", "map", "jmap", "jmap-uniform") for word in ("--estimator", name)]
REACHES, YEARS = 10_000, 30
"""Reaches and years of the projected fleet."""

DAYS_A_YEAR = 365.25


@dataclass(frozen=True)
class Measured:
    """Resources of a run over a fleet; `thirds` are the days per second of its first to last third."""

    name: str
    reaches: int
    days: int
    used: Usage
    thirds: tuple[float, ...]
    logs_bytes: float
    results_bytes: float

    @property
    def rate(self) -> float:
        """Days per second."""
        return self.days / self.used.seconds


def command(data: Path, out: Path, *more: str) -> list[str]:
    """Return the measured command `rivid run`: two workers."""
    more = more if "--estimator" in more else (*more, "--estimator", "jmap")
    return [PYTHON, "-m", "rivid", "run", str(data), "--out", str(out), "-q", "--workers", "2", *more]


def measure(name: str, data: Path, out: Path, reaches: int, days: int) -> Measured:
    """Run an existing fleet with `days` of each reach, tables without figures."""
    used = process(command(data, out, "--no-figures"))
    ends = np.sort([p.stat().st_mtime for p in (out / ".rivid" / "outcomes").glob("*.json")])
    cuts = [0, reaches // 3, 2 * reaches // 3, reaches - 1]
    thirds = tuple(
        (b - a) * days / max(ends[b] - ends[a], 1e-9) for a, b in zip(cuts, cuts[1:], strict=False) if b > a
    )
    return Measured(name, reaches, reaches * days, used, thirds, size_of(data), size_of(out))


def size_of(folder: Path) -> float:
    """Return the bytes of all files below a directory."""
    return float(sum(p.stat().st_size for p in folder.rglob("*") if p.is_file()))


def grown(runs: list[Measured]) -> str:
    """Return the table of all sizes."""
    rows = [
        [
            m.name,
            f"{m.reaches}",
            f"{m.days:,}",
            f"{m.used.seconds:.0f} s",
            f"{m.rate:.0f}",
            " / ".join(f"{t:.0f}" for t in m.thirds),
            f"{m.used.cpu / m.days * 1e3:.2f} ms",
            f"{m.used.own_mb:.0f} MB",
            f"{m.used.peak_mb:.0f} MB",
        ]
        for m in runs
    ]
    head = [
        "logs", "reaches", "days", "wall time", "days a second", "in its first / middle / last third",
        "processor time a day", "the command itself", "largest process",
    ]  # fmt: skip
    return table(head, rows)


@dataclass(frozen=True)
class Morning:
    """A finished fleet with one new day for each reach, in its own Parquet file; times per reach [s]."""

    reaches: int
    days: int
    wall: float
    idle: float
    seconds: float


def morning(season: Season, data: Path, out: Path, reaches: int, days: int) -> Morning:
    """Run a finished fleet with one new day for every reach, and again without new days."""
    arrays = (season.inflow, season.outflow, season.level)
    first = dt.date(1995, 1, 1) + dt.timedelta(days=days)
    for r in range(reaches):
        write_reach(arrays, season.sample_time, data / f"r{r:05d}", r, 1, "parquet", first)
    used = process(command(data, out, "--no-figures"))
    idle = process(command(data, out, "--no-figures"))
    return Morning(reaches, days, used.seconds / reaches, idle.cpu / reaches, used.cpu / reaches)


def drawn(season: Season, work: Path, reaches: int, days: int) -> tuple[float, float]:
    """Measure the processor time [s] of figures and page of a reach, with one estimator and with four."""
    data = work / "drawn"
    write_fleet(season, data, reaches, days, "parquet")
    taken = []
    for more in ([], FOUR):
        with_figures, without = [], []
        for turn in range(3):
            out = work / f"drawn_out{turn}"
            without.append(process(command(data, out, *more, "--no-figures")).cpu)
            shutil.rmtree(out)
            with_figures.append(process(command(data, out, *more)).cpu)
            shutil.rmtree(out)
        taken.append((median(with_figures) - median(without)) / reaches)
    return taken[0], taken[1]


def estimating(season: Season, work: Path, reaches: int, days: int) -> list[list[str]]:
    """Measure the processor time of a day by estimators: Parquet logs, tables, no figures."""
    data = work / "estimating"
    write_fleet(season, data, reaches, days, "parquet")
    rows = []
    for name, words in {
        "`jmap`": [],
        "`ml`, `map`, `jmap`, `jmap-uniform`": FOUR,
        "`posterior`": ["--estimator", "posterior"],
    }.items():
        out = work / "estimating_out"
        used = process(command(data, out, *words, "--no-figures"))
        a_day, bytes_a_day = used.cpu / (reaches * days), size_of(out) / (reaches * days)
        rows.append([name, *projected(a_day, bytes_a_day)])
        shutil.rmtree(out)
    return rows


def projected(cpu_a_day: float, bytes_a_day: float) -> list[str]:
    """Return cells: processor time of a day, and processor time and disk space of the projected fleet."""
    days = REACHES * YEARS * DAYS_A_YEAR
    hours = cpu_a_day * days / 3600
    return [
        f"{cpu_a_day * 1e3:.2f} ms",
        f"{hours:,.0f}",
        f"{hours / 64:.1f} h",
        f"{bytes_a_day * days / 1e12:.2f} TB",
    ]


def page(
    runs: list[Measured], by_estimator: list[list[str]], new_day: Morning, drawing: tuple[float, float]
) -> str:
    """Return the page docs/scale.md."""
    small, large = runs[-2], runs[-1]
    rates = [m.rate for m in runs if m.name == large.name]
    log_bytes = large.logs_bytes / large.days * REACHES * YEARS * DAYS_A_YEAR / 1e12
    return f"""# A fleet at its size

Written by `make scale`, on this machine: {machine()}, numpy {np.__version__}. The logs are generated for the measurement
(`benchmarks/generator.py`): days of a simulated season, each scaled, shifted and disturbed at random; 650 samples a day; no
two files are alike. CSV: a file a day. Parquet: a file a year. Two workers, `jmap`, tables without figures.

{grown(runs)}
From {small.days:,} to {large.days:,} days of {large.name} logs the days per second differ by {(max(rates) / min(rates) - 1) * 100:.0f} %. The
last columns are the peak memory of the command itself and of the largest of all its processes. Each reach is processed by one
worker; the command holds a few numbers for each reach.

## {REACHES:,} reaches, {YEARS} years

The following is arithmetic on measurements, {REACHES * YEARS * DAYS_A_YEAR / 1e6:.1f} million days: processor time is proportional to days
(table above; the times below are of fewer and larger reaches), reaches are independent, and `--shard I/N` or Dask distribute them. Logs of this size take
{log_bytes:.2f} TB as Parquet ({large.logs_bytes / large.days / 1e3:.1f} kB a day).

{table(["estimators", "processor time a day", "core-hours", "on 64 cores", "results"], by_estimator)}
Figures and page of a reach of ten years take {drawing[0]:.1f} s of a core with one estimator and {drawing[1]:.1f} s with four:
{drawing[0] * REACHES / 3600:.0f} and {drawing[1] * REACHES / 3600:.0f} core-hours for all. With `--no-figures` and `rivid figures OUT` they are drawn only for
the reaches that are inspected.

Every morning, one new day each, in {new_day.reaches} reaches of {new_day.days:,} finished days: {new_day.wall:.2f} s per reach on two cores,
{new_day.seconds:.2f} s of a core, of which {new_day.idle:.2f} s to check that nothing else is new; {new_day.seconds * REACHES / 3600:.1f} core-hours for {REACHES:,} reaches. The rest
estimates the day and rewrites the tables of the reach, byte for byte those of a run from scratch.
"""


def main() -> None:
    """Run all measurements, print, and write the page."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--quick", action="store_true", help="a hundredth of the size, no page")
    parser.add_argument("--work", type=Path, help="folder of logs and results, up to 10 GB; default: TMPDIR")
    given = parser.parse_args()
    less = 100 if given.quick else 1
    days = 10_000 // (10 if given.quick else 1)
    season = simulate(load_scenario(ROOT / "configs" / "scenarios" / "basse_isere.toml"), seed=1)
    with tempfile.TemporaryDirectory(dir=given.work) as directory:
        work = Path(directory)
        runs = []
        for format, reaches in (("csv", 10), ("parquet", 10), ("parquet", 100)):
            reaches = max(3, reaches * 10 // less) if given.quick else reaches
            data, out = work / f"{format}{reaches}", work / f"{format}{reaches}_out"
            write_fleet(season, data, reaches, days, format)
            runs.append(measure({"csv": "CSV", "parquet": "Parquet"}[format], data, out, reaches, days))
            print(grown(runs[-1:]), flush=True)
            if len(runs) == 3:
                new_day = morning(season, data, out, reaches, days)
                print(json.dumps(new_day.__dict__), flush=True)
            shutil.rmtree(data)
            shutil.rmtree(out)
        by_estimator = estimating(season, work, 4, days // 5)
        drawing = drawn(season, work, 4, 3652 // (10 if given.quick else 1))
    text = page(runs, by_estimator, new_day, drawing)
    print(text)
    if not given.quick:
        (ROOT / "docs" / "scale.md").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
