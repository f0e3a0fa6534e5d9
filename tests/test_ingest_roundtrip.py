"""Test sample days in dialects that the corpus lacks, and back: identical arrays and estimates."""

import datetime as dt
import gzip
import io
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from click.testing import CliRunner

from rivid.cli import cli
from rivid.config import Config, load_config, parse
from rivid.logs.days import find_days, read_window
from rivid.logs.exports import ingest

ROOT = Path(__file__).parent.parent
SAMPLE = ROOT / "sample_data" / "basse_isere_csv"
CET = dt.timezone(dt.timedelta(hours=1))
NAMES = ("u_Qi", "u_Qo", "h_L")
N_DAYS = 3
STEP = 133


def arrays_of(folder, config, n_days=N_DAYS):
    """Return inflow, outflow and level by date."""
    days = find_days(folder, config).days[:n_days]
    found = {}
    for source in days:
        data = read_window(folder, [source], config)
        assert data.n_filled == 0
        found[source.date] = (data.inflow, data.outflow, data.output)
    return found


@pytest.fixture(scope="module")
def original():
    return arrays_of(SAMPLE, Config())


def samples(original):
    """Yield local moments with three numbers as exact text."""
    for date, columns in original.items():
        midnight = dt.datetime.combine(date, dt.time(), CET)
        for k, values in enumerate(zip(*columns, strict=True)):
            yield midnight + dt.timedelta(seconds=STEP * k), [repr(float(v)) for v in values]


def text(lines, encoding="utf-8", newline="\n"):
    return (newline.join(lines) + newline).encode(encoding)


def wide(original, form="%Y-%m-%d %H:%M:%S", separator=",", decimal=".", quote=""):
    lines = [separator.join(["time", *NAMES])]
    for moment, cells in samples(original):
        cells = [quote + cell.replace(".", decimal) + quote for cell in cells]
        lines.append(separator.join([moment.strftime(form), *cells]))
    return lines


def long_rows(original):
    """Return a row per value, the last first."""
    for moment, cells in reversed(list(samples(original))):
        for tag, value in zip(NAMES, cells, strict=True):
            yield f"{moment:%Y-%m-%d %H:%M:%S},{tag},{value}"


def parquet(columns):
    sink = io.BytesIO()
    pq.write_table(pa.table(columns), sink)
    return sink.getvalue()


def wide_parquet(original):
    moments, values = zip(*samples(original), strict=True)
    columns = {"when": pa.array(moments, pa.timestamp("us", "UTC"))}
    return columns | {n: [float(v[j]) for v in values] for j, n in enumerate(NAMES)}


def long_parquet(original):
    rows = [(m, t, float(c[j])) for m, c in samples(original) for j, t in enumerate(NAMES)]
    moments, tags, values = zip(*rows, strict=True)
    return {
        "ts": pa.array(moments, pa.timestamp("ms", "UTC")),
        "tag": list(tags),
        "value": list(values),
        "status": ["Good"] * len(rows),
    }


LOCAL = {"time_zone": "Etc/GMT-1"}
LONG = {**LOCAL, "layout": "long", "tag": "tag"}
DIALECTS = {
    "iso with offset": lambda o: ({"a.csv": text(wide(o, "%Y-%m-%dT%H:%M:%S+01:00"))}, {}),
    "gzip": lambda o: ({"a.csv.gz": gzip.compress(text(wide(o)))}, LOCAL),
    "semicolons and decimal commas": lambda o: (
        {"a.txt": text(wide(o, "%d/%m/%Y %H:%M:%S", ";", ","), "latin-1", "\r\n")},
        {**LOCAL, "separator": ";", "decimal": ",", "time_format": "%d/%m/%Y %H:%M:%S", "encoding": "cp1252"},
    ),
    "quoted decimal commas": lambda o: (
        {"a.csv": text(wide(o, decimal=",", quote='"'))},
        {**LOCAL, "decimal": ","},
    ),
    "comments between": lambda o: (
        {"a.csv": text(["# top", *wide(o)[:700], "# half", *wide(o)[700:]])},
        {**LOCAL, "comment": "#"},
    ),
    "a file for each thousand rows, overlapping": lambda o: (
        {f"{i}.csv": text([wide(o)[0], *wide(o)[1 + 1000 * i : 1050 + 1000 * i]]) for i in range(2)},
        LOCAL,
    ),
    "unix": lambda o: (
        {"a.csv": text(["time,u_Qi,u_Qo,h_L",
                        *(",".join([str(int(m.timestamp())), *c]) for m, c in samples(o))])},
        {**LOCAL, "time_format": "unix"},
    ),
    "long backwards": lambda o: (
        {"a.csv": text(["time,tag,value", *long_rows(o)])},
        LONG,
    ),
    "Parquet": lambda o: ({"a.parquet": parquet(wide_parquet(o))}, {**LOCAL, "time": "when"}),
    "long Parquet": lambda o: (
        {"a.pq": parquet(long_parquet(o))},
        {**LONG, "time": "ts", "quality": "status", "good": ["Good"]},
    ),
}  # fmt: skip


def ingested(name, original, tmp_path, form="csv"):
    files, given = DIALECTS[name](original)
    paths = [tmp_path / file for file in files]
    for path in paths:
        path.write_bytes(files[path.name])
    outcome = ingest(paths, tmp_path / "logs", parse({"input": given}, Config), format=form)
    assert outcome.exit_code == 0, [day.reason for day in outcome.days]
    return outcome


@pytest.mark.parametrize(("name", "form"), [*((name, "csv") for name in DIALECTS), ("gzip", "parquet")])
def test_sample_days_come_back_identical(tmp_path, original, name, form):
    outcome = ingested(name, original, tmp_path, form)
    found = arrays_of(tmp_path / "logs", load_config(outcome.run_config))
    assert list(found) == list(original)
    for date, columns in original.items():
        for ours, theirs in zip(found[date], columns, strict=True):
            np.testing.assert_array_equal(ours, theirs)


def test_the_first_dialect_gives_the_very_bytes_of_the_sample(tmp_path, original):
    ingested("iso with offset", original, tmp_path)
    for path in sorted(SAMPLE.glob("*.csv"))[:N_DAYS]:
        assert (tmp_path / "logs" / path.name).read_bytes() == path.read_bytes()


def test_run_estimates_the_same_from_ingested_logs_as_from_the_sample(tmp_path, original):
    outcome = ingested("semicolons and decimal commas", original, tmp_path)
    words = ["--no-figures", "--quiet", "--workers", "1", "--to", str(max(original))]
    for folder, config, out in ((SAMPLE, None, "a"), (tmp_path / "logs", outcome.run_config, "b")):
        more = [] if config is None else ["--config", str(config)]
        done = CliRunner().invoke(
            cli, ["run", str(folder), "--out", str(tmp_path / out), *words, *more], standalone_mode=False
        )
        assert done.return_value == 0, done.output
    ours, theirs = ((tmp_path / out / "delays.csv").read_text() for out in "ba")
    assert ours == theirs and ours.count("\n") == 2 * N_DAYS + 1
