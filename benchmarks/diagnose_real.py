"""Diagnose the measured river with its bypass hidden, and compare the result with the recorded bypass.

The diagnosis receives the power release and the discharge at Lees Ferry. The recorded bypass is only used
afterwards. Writes docs/diagnose_real.md and its picture. Usage: python -m benchmarks.diagnose_real
"""

import datetime as dt
import shutil
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.measure import table
from rivid.config import Config, load_config
from rivid.diagnosis.answer import conclude
from rivid.diagnosis.blocks import split
from rivid.diagnosis.choice import gauge_floor_of, library_of, response_of, responses_of
from rivid.diagnosis.data import Record, read_record
from rivid.diagnosis.decision import Study
from rivid.diagnosis.explanation import Explanation, fitted, scored, tails_of
from rivid.diagnosis.fit import HOURS, Model
from rivid.diagnosis.workflow import COARSE, find_effects
from rivid.report.diagnosis import write_diagnosis
from rivid.types import Bools, Floats

ROOT = Path(__file__).parent.parent
LOGS = ROOT / "sample_data" / "glen_canyon"
CFS = 0.028316846592
QUIET = dt.date(2024, 6, 30)


def configs() -> tuple[Config, Config]:
    """Return the configuration of the diagnosis, and the same with the total release as inflow."""
    seen = load_config(ROOT / "configs" / "glen_canyon_bypass.toml")
    truth = seen.model_copy(update={"input": seen.input.model_copy(update={"u_Qi": "total_release_cfs"})})
    return seen, truth


def studied(config: Config, record: Record) -> Study:
    """Return the study of a record, as `rivid diagnose` makes it."""
    return find_effects(
        record, responses_of(config, record), library_of(config), most=config.diagnose.most_effects,
        gauge_floor=gauge_floor_of(config, record),
    )  # fmt: skip


def floor_of(config: Config, record: Record) -> Floats:
    """Return the held-out errors of the model with the total release, fitted to the same other days."""
    dealt = split(record.dates)
    opened = dealt.fit | dealt.select
    model = Model(
        response_of(config, record), None, record.usual_output, record.usual_flow,
        gauge_floor_of(config, record),
    )  # fmt: skip
    part = record.take(np.flatnonzero(opened)[::COARSE])
    rough = fitted(model, part, np.ones(part.days, bool), steps=8, fresh=8).model
    one = fitted(replace(rough, noise=None), record, opened, steps=8, fresh=2)
    return errors_of(scored(one, record, dealt.block, tails_of(one, record)), dealt.sealed)


def errors_of(one: Explanation, days: Bools) -> Floats:
    """Return the RMSE of some days at 1, 4 and 24 h."""
    assert one.errors is not None
    return one.errors.rmse(days)[-len(HOURS) :]


def main() -> None:
    """Diagnose, compare with the record, and write the page."""
    seen, truth = configs()
    record, whole = (read_record(LOGS, config)[0] for config in (seen, truth))
    both = sorted(set(record.dates) & set(whole.dates))
    record = record.take([d in both for d in record.dates])
    whole = whole.take([d in both for d in whole.dates])
    begin = time.perf_counter()
    study = studied(seen, record)
    floor = floor_of(truth, whole)
    answer, evidence = conclude(study, library_of(seen), floor.tolist())
    took = time.perf_counter() - begin

    bypass = whole.inflow - record.inflow
    model = study.last.model
    carried = model.reach.baseline(whole, model.changes(whole)) - model.reach.baseline(
        record, model.changes(record)
    )
    runs = np.abs(bypass[:, record.lead :]).max(axis=1) > 5.0
    season = [d for d, on in zip(record.dates, runs, strict=True) if on]
    days = np.array([season[0] <= d <= season[-1] for d in record.dates])
    used = record.used & days[:, None]
    r = float(np.corrcoef(evidence.inflow_before[used], carried[used])[0, 1])
    sealed = used & study.split.sealed[:, None]
    r_sealed = float(np.corrcoef(evidence.inflow_before[sealed], carried[sealed])[0, 1])
    releases = [e for e in answer.effects if e.name == "unlogged_upstream_release"]
    found = np.zeros(record.days, bool)
    for e in releases:
        assert e.where.dates is not None
        found |= np.array([e.where.dates[0] <= d <= e.where.dates[1] for d in record.dates])
    overlap = float((found & days).sum() / (found | days).sum())
    base, end = (errors_of(one, study.split.sealed) for one in (study.first, study.last))
    b, e, f = (np.square(errors) for errors in (base, end, floor))
    closed = ((b - e) / (b - f)).tolist()

    quiet = read_record(LOGS, seen, last=QUIET)[0]
    calm, _ = conclude(studied(seen, quiet), library_of(seen), None)

    rows = [
        ["names", "a bypass at the dam", "; ".join(e.name for e in answer.effects)],
        ["dates", f"{season[0]} to {season[-1]}",
         "; ".join(f"{e.where.dates[0]} to {e.where.dates[1]}" for e in releases if e.where.dates)],
        ["overlap of dates", "", f"{overlap:.2f}"],
        ["hours", "about 22 to 14", "; ".join(str(e.where.hours) for e in releases)],
        ["mean flow while it runs [m3/s]", f"{bypass[days][:, record.lead:][bypass[days][:, record.lead:] > 5].mean():.0f}",
         "; ".join(", ".join(f"{p.value:.0f}" for p in e.parameters if p.name.startswith("size")) for e in releases)],
        ["course: correlation of the unexplained inflow with the routed bypass", "1",
         f"{r:.3f}; on held-out days {r_sealed:.3f}"],
    ]  # fmt: skip
    gaps = [
        [name, *(f"{v:.1f}" for v in values)]
        for name, values in (("without", base), ("with the named effects", end), ("bypass given", floor))
    ]
    gaps.append(["gap closed", *(f"{c:.2f}" for c in closed)])
    text = (
        "# The hidden bypass of Glen Canyon Dam\n\n"
        "Written by `make diagnose-real`. The diagnosis receives the power release of the dam and the discharge at\n"
        "Lees Ferry ([configs/glen_canyon_bypass.toml](../configs/glen_canyon_bypass.toml)). From July to November\n"
        "2024 the dam also released water through its bypass, which is not in these logs. Its record is used below to\n"
        "judge the result, not to obtain it.\n\n"
        f"Verdict: **{answer.verdict}**. {answer.reason}\n\n"
        "![Unexplained inflow by hour and date, before and after the diagnosis](pictures/glen_canyon_bypass.png)\n\n"
        + table(["", "recorded", "found"], rows)
        + "\nError of the simulated discharge on the held-out days [m3/s]:\n\n"
        + table(["", "1 h", "4 h", "24 h"], gaps)
        + f"\nMay and June 2024 alone, without a bypass: **{calm.verdict}**, "
        + (f"named: {', '.join(e.name for e in calm.effects)}" if calm.effects else "nothing named")
        + f".\n\nThe whole record, {record.days} days, took {took:.0f} s.\n"
    )
    with tempfile.TemporaryDirectory() as folder:
        write_diagnosis(Path(folder), answer, evidence, reach=seen.reach.name)
        shutil.copy(
            Path(folder) / "figures" / "diagnosis_map.png",
            ROOT / "docs" / "pictures" / "glen_canyon_bypass.png",
        )
    (ROOT / "docs" / "diagnose_real.md").write_text(text, encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main()
