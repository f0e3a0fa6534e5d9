"""Evaluate all measured data of the project: travel times, and diagnoses of windows of 60 days.

Travel times are compared with known ones. Writes docs/real.md. Usage: python -m benchmarks.real
"""

import datetime as dt
import time
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import rivid
from benchmarks.measure import machine, table
from rivid.config import Config, load_config
from rivid.diagnosis import workflow
from rivid.diagnosis.choice import gauge_floor_of, library_of, responses_of
from rivid.diagnosis.data import Record, read_record
from rivid.errors import RividError
from rivid.types import Floats

ROOT = Path(__file__).parent.parent
PAGE, DATA = ROOT / "docs" / "real.md", ROOT / "sample_data" / "glen_canyon"
CFS = 0.028316846592
LENGTH, STRIDE, WINDOW = 60, 30, 3
"""Days of a diagnosis, days between the starts of two diagnoses, and days of a data set of `posterior`."""
CLASSES = ((0.0, 8000.0, 7.5), (8000.0, 11_000.0, 6.75), (11_000.0, 14_000.0, 6.25))
"""Lees Ferry to mile 30: limits of a class of discharge [cfs], and its median daily lag [h]."""
SURE = 0.95


@dataclass(frozen=True)
class Reach:
    """A reach, its known lag [h] and the uncertainty of the lag [h]; `hidden` if the bypass is not given."""

    name: str
    config: Config
    lag: float
    doubt: float
    hidden: bool = False


def reaches() -> list[Reach]:
    """Return the three reaches; the first one also without its bypass."""
    dam = load_config(ROOT / "configs" / "glen_canyon.toml")
    power = load_config(ROOT / "configs" / "glen_canyon_bypass.toml")
    canyon = load_config(ROOT / "configs" / "glen_canyon_rm30.toml")
    lower = canyon.model_dump(mode="json", exclude_none=True, exclude_unset=True)
    lower["reach"] |= {"name": "mile-30-to-61", "length": 50_000.0}
    lower["input"] |= {"u_Qi": "rm30_cfs", "Q_L": "rm61_cfs", "units": {"u_Qi": "cfs", "Q_L": "cfs"}}
    return [
        Reach("dam to Lees Ferry, power release", power, 3.0, 1.0, hidden=True),
        Reach("dam to Lees Ferry, all of the release", dam, 3.0, 1.0),
        Reach("Lees Ferry to mile 30", canyon, 6.5, 0.25),
        Reach("mile 30 to mile 61", Config.model_validate(lower), 7.5, 0.25),
    ]


def record_of(reach: Reach) -> Record:
    """Return all days of a reach."""
    return read_record(DATA, reach.config)[0]


def diagnosed(reach: Reach, record: Record) -> tuple[list[list[str]], Counter[str], list[float]]:
    """Return a row for each window, the names of (partly) explained windows, and the durations [s]."""
    rows: list[list[str]] = []
    sure: Counter[str] = Counter()
    taken = []
    bypass = bypass_days() if reach.hidden else {}
    first = record.dates[0]
    for start in range(0, (record.dates[-1] - first).days - LENGTH + 2, STRIDE):
        begin, end = first + dt.timedelta(days=start), first + dt.timedelta(days=start + LENGTH - 1)
        few, began = record.take([begin <= day <= end for day in record.dates]), time.perf_counter()
        try:
            few, _ = read_record(DATA, reach.config, first=begin, last=end)
            found, _ = workflow.diagnose(
                few, responses_of(reach.config, few), library_of(reach.config),
                gauge_floor=gauge_floor_of(reach.config, few), most=reach.config.diagnose.most_effects,
            )  # fmt: skip
        except RividError as error:
            rows.append([f"{begin} to {end}", f"failed: {error}", "", "", ""])
            continue
        taken.append(time.perf_counter() - began)
        names = list(dict.fromkeys(e.name for e in found.effects))
        words = ", ".join(
            f"{n} {max(e.probability or 0.0 for e in found.effects if e.name == n):.2f}"
            + (
                f" or {', '.join(t)}"
                if (t := next(e.tied_with for e in found.effects if e.name == n))
                else ""
            )
            for n in names
        )
        if found.verdict in ("explained", "partly_explained"):
            sure.update(names)
        gap = found.gap
        shown = "" if gap is None else f"{gap.rmse_baseline[1]:.1f}"
        end_ = "" if gap is None else f"{(gap.rmse_described or gap.rmse_augmented)[1]:.1f}"
        on = sum(bypass.get(day, 0.0) > 5.0 for day in few.dates)
        rows.append(
            [f"{begin} to {end}", str(on) if reach.hidden else "", found.verdict, words, f"{shown} to {end_}"]
        )
        print(reach.name, *rows[-1], flush=True)
    return rows, sure, taken


def bypass_days() -> dict[dt.date, float]:
    """Return the mean bypass flow of each day [m3/s], from its record, which no diagnosis receives."""
    config = load_config(ROOT / "configs" / "glen_canyon_bypass.toml")
    only = config.model_copy(update={"input": config.input.model_copy(update={"u_Qi": "bypass_release_cfs"})})
    record, _ = read_record(DATA, only)
    return dict(zip(record.dates, record.inflow[:, record.lead :].mean(axis=1).tolist(), strict=True))


def travelled(reach: Reach, record: Record) -> str:
    """Return the table of t50 of three-day windows by `posterior` and the known lag."""
    n = record.time.shape[1] - record.lead
    runs = [
        k for k in range(0, record.days - WINDOW + 1, WINDOW)
        if (record.dates[k + WINDOW - 1] - record.dates[k]).days == WINDOW - 1
    ]  # fmt: skip
    parts: list[Floats] = [
        np.stack([a[k : k + WINDOW, -n:].ravel() for k in runs]) for a in (record.inflow, record.output)
    ]
    whole = np.isfinite(parts[1]).all(axis=1)
    u, y = (p[whole] for p in parts)
    began = time.perf_counter()
    found = rivid.posterior(u, y, config=reach.config)
    seconds = time.perf_counter() - began
    T = reach.config.reach.sample_time / 3600.0
    ok = np.isfinite(found.delay)
    t50, low, high = (np.asarray(v)[ok] * T for v in (found.travel, found.delay_low, found.delay_high))
    flow = u.mean(axis=1)[ok] / CFS
    known = np.full(len(t50), reach.lag)
    doubt = np.full(len(t50), reach.doubt)
    if reach.config.reach.name == "marble-canyon-rm30":
        for a, b, lag in CLASSES:
            known[(flow >= a) & (flow < b)] = lag
    inside = (known >= low - doubt - 0.5 * T) & (known <= high + doubt + 0.5 * T)
    return table(
        ["windows", "answered", "t50 [h], median (80 %)", "lag of the cross-correlation [h]", "share of 90 % sets that hold this lag, with its uncertainty", "time"],
        [[str(len(u)), f"{ok.mean():.2f}", f"{np.median(t50):.2f} ({np.quantile(t50, 0.1):.2f}-{np.quantile(t50, 0.9):.2f})",
          "7.5, 6.75, 6.25 by flow" if reach.config.reach.name == "marble-canyon-rm30" else f"{reach.lag:g}",
          f"{inside.mean():.2f}", f"{seconds:.1f} s"]],
    )  # fmt: skip


def main() -> None:
    """Write the page."""
    text = (
        "# Measured rivers\n\nWritten by `make real`: all measured data of the project "
        "([provenance](../sample_data/glen_canyon/README.md)), 426 days of the Colorado between Glen Canyon Dam and "
        f"river mile 61. Machine: {machine()}. Travel times are those of `posterior` on data sets of {WINDOW} days. "
        "The known lags are the peaks of the cross-correlation of differences, to a sample. The hourly release has an "
        f"uncertainty of one hour. Diagnoses cover every window of {LENGTH} days, {STRIDE} days apart. Below the "
        "dam, the first section gives only the power release to the diagnosis, while the bypass ran on the days that are "
        "counted (more than 5 m³/s). In the other sections nothing is known to be missing except small tributaries, "
        "bank storage and differences between the ratings of the gauges, so a name there cannot be verified by a "
        "record. Short windows are more difficult than a year: where the bypass runs on all days, its dates are not visible, and a "
        "gain error may replace it. A rating error of a percent, or a spring, appears as a tie of ratings and "
        "inflows, or as one of them. A name with a probability of 0.95 or more that a record contradicts would be a false alarm.\n"
    )
    for reach in reaches():
        record = record_of(reach)
        rows, sure, taken = diagnosed(reach, record)
        counts = Counter(row[2] for row in rows)
        listed = ", ".join(f"{n} {v}" for v, n in counts.most_common())
        named = ", ".join(f"{name} ({n})" for name, n in sure.most_common()) or "none"
        text += f"\n## {reach.name}\n\n{travelled(reach, record)}\n"
        text += (
            f"Verdicts of {len(rows)} windows: {listed}. Names in explained and partly explained windows: {named}. "
            f"A diagnosis took {np.median(taken):.0f} s (median).\n\n"
        )
        head = ["days", "bypass ran on", "verdict", "names, probability", "error after 4 h [m3/s]"]
        text += table(head, rows)
    PAGE.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
