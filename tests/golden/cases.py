"""Results of the command line as plain values: tables, JSON, TOML and exit codes."""

import contextlib
import io
import json
import math
import tomllib
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
from click.testing import CliRunner

from rivid.cli import cli

ROOT = Path(__file__).resolve().parents[2]
EXPORTS = ROOT / "tests" / "data" / "exports"
WORDS = {"message", "regime", "breaker", "comment", "text", "reason"}
"""Keys and columns with sentences: their wording is not compared."""
TABLES = ("delays", "fir", "criterion", "posterior")
ALL = ("ml", "map", "jmap", "jmap-uniform", "jmap-uniform-estimated", "jmap-degenerate", "direct", "indirect",
       "cusum-ml", "cusum-map", "posterior")  # fmt: skip
DIAGNOSES = {
    "clock_offset": "configs/scenarios/effects/clock_offset.toml",
    "diurnal_inflow": "configs/scenarios/effects/diurnal_inflow.toml",
    "release": "configs/scenarios/effects/unlogged_upstream_release.toml",
    "gains": "configs/scenarios/pairs/gains.toml",
    "outside": "configs/scenarios/outside/siphon.toml",
    "nothing": "configs/scenarios/hydraulic_short.toml",
}
DIAGNOSED_TO = "2008-02-09"
"""Last of forty days: enough for two cycles of blocks."""


def rivid(*words):
    """Return exit code and standard output of a command, run in this process."""
    done = CliRunner().invoke(cli, [str(word) for word in words])
    if done.exception is not None and not isinstance(done.exception, SystemExit):
        raise done.exception
    return done.exit_code, done.stdout


def table(path):
    """Return a Parquet table as columns of floats or strings, without the sentences."""
    found = {}
    for name, column in zip((t := pq.read_table(path)).column_names, t.columns, strict=True):
        if name not in WORDS:
            values = column.to_pylist()
            numeric = all(v is None or isinstance(v, (int, float)) for v in values)
            found[name] = np.array([math.nan if v is None else v for v in values]) if numeric else np.array(
                ["" if v is None else str(v) for v in values]
            )  # fmt: skip
    return found


def thinned(columns, every):
    """Return the rows of each `every`-th date."""
    keep = np.isin(columns["date"], np.unique(columns["date"])[::every])
    return {name: values[keep] for name, values in columns.items()}


def run_tables(out, prefix, every=1):
    """Return the tables of a run; all rows of delays, the long tables on each `every`-th day."""
    for name in TABLES:
        path = out / f"{name}.parquet"
        if path.exists():
            yield f"{prefix}/{name}", thinned(table(path), 1 if name == "delays" else every)


def runs(tmp):
    """Return tables and exit codes of a fleet, of all estimators, and of a river's posterior."""
    code, _ = rivid(
        "run", ROOT / "sample_data", "-c", ROOT / "configs/fleet", "-o", tmp / "fleet", "--no-figures", "-q"
    )
    yield "fleet/exit", code
    for reach in ("basse_isere", "basse_isere_csv", "glen_canyon"):
        yield from run_tables(tmp / "fleet" / reach, f"fleet/{reach}", every=30)
    asked = [word for name in ALL for word in ("--estimator", name)]
    code, _ = rivid("run", ROOT / "sample_data/basse_isere_csv", "-c", ROOT / "configs/basse_isere.toml",
                    "-o", tmp / "week", "--no-figures", "-q", *asked)  # fmt: skip
    yield "week/exit", code
    yield from run_tables(tmp / "week", "week")
    code, _ = rivid("run", ROOT / "sample_data/glen_canyon", "-c", ROOT / "configs/glen_canyon_rm30.toml",
                    "-o", tmp / "river", "--no-figures", "-q", "--estimator", "posterior",
                    "--to", "2024-05-31")  # fmt: skip
    yield "river/exit", code
    yield from run_tables(tmp / "river", "river", every=3)


def corpus(tmp):
    """Return the proposal of sniff and the logs of ingest for each export."""
    for case in sorted(path.parent for path in EXPORTS.glob("*/config.toml")):
        files = sorted(p for p in case.iterdir() if p.name not in {"config.toml", "expected.csv"})
        code, text = rivid("sniff", *files, "--time-zone", "Etc/GMT-1")
        with contextlib.suppress(tomllib.TOMLDecodeError):
            yield f"sniff/{case.name}", {"exit": code, "toml": tomllib.loads(text)}
        out = tmp / "ingested" / case.name
        code, text = rivid("ingest", *files, "-c", case / "config.toml", "-o", out, "--json")
        logs = {p.name: p.read_text() for p in sorted(out.glob("*.csv"))} if out.exists() else {}
        config = out.parent / f"{case.name}_run.toml"
        yield (
            f"ingest/{case.name}",
            {
                "exit": code,
                "json": _without_paths(json.loads(text)) if text.strip() else None,
                "logs": {name: _columns(body) for name, body in logs.items()},
                "config": tomllib.loads(config.read_text()) if config.exists() else None,
            },
        )


def _columns(body):
    """Return a CSV log as its header, first time, and the sums of its values."""
    rows = [line.split(",") for line in io.StringIO(body).read().splitlines()]
    sums = [sum(float(row[k] or 0) for row in rows[1:]) for k in range(1, len(rows[0]))]
    return {"header": rows[0], "first": rows[1][0], "last": rows[-1][0], "rows": len(rows), "sums": sums}


def checks(tmp):
    """Return the findings of check in the sample data."""
    for name, config in {
        "basse_isere": "basse_isere",
        "basse_isere_csv": "basse_isere",
        "glen_canyon": "glen_canyon",
    }.items():
        code, text = rivid(
            "check", ROOT / "sample_data" / name, "-c", ROOT / f"configs/{config}.toml", "--json"
        )
        yield f"check/{name}", {"exit": code, "json": _without_paths(json.loads(text))}


def diagnoses(tmp, names=tuple(DIAGNOSES)):
    """Return diagnosis.json and model.toml of simulated seasons."""
    for name in names:
        logs, out = tmp / name, tmp / f"{name}_found"
        rivid("simulate", ROOT / DIAGNOSES[name], "-o", logs, "-q")
        code, _ = rivid("diagnose", logs, "-o", out, "--no-figures", "-q", "--to", DIAGNOSED_TO)
        yield (
            f"diagnosis/{name}",
            {
                "exit": code,
                "json": json.loads((out / "diagnosis.json").read_text()),
                "model": tomllib.loads((out / "model.toml").read_text())
                if (out / "model.toml").exists()
                else None,
            },
        )


def _without_paths(value):
    """Return JSON without sentences and without paths of this machine."""
    if isinstance(value, dict):
        return {k: _without_paths(v) for k, v in value.items() if k not in WORDS}
    if isinstance(value, list):
        return [_without_paths(v) for v in value]
    return "" if isinstance(value, str) and "/" in value else value


def differences(found, expected, at="", tolerance=1e-9):
    """Return where two values differ: numbers by more than `tolerance` (relative), texts except sentences."""
    if isinstance(expected, dict):
        expected = {k: v for k, v in expected.items() if k not in WORDS}
        missing = [f"{at}/{k}: missing" for k in expected if not isinstance(found, dict) or k not in found]
        if missing:
            return missing
        return [d for k, v in expected.items() for d in differences(found[k], v, f"{at}/{k}", tolerance)]
    if isinstance(expected, list):
        if not isinstance(found, list) or len(found) != len(expected):
            return [f"{at}: {found!r} is not of length {len(expected)}"]
        return [
            d
            for k, (a, b) in enumerate(zip(found, expected, strict=True))
            for d in differences(a, b, f"{at}/{k}", tolerance)
        ]
    if isinstance(expected, bool) or expected is None:
        return [] if found is expected else [f"{at}: {found!r} instead of {expected!r}"]
    if isinstance(expected, (int, float)):
        near = isinstance(found, (int, float)) and (
            math.isclose(found, expected, rel_tol=tolerance, abs_tol=1e-12)
            or found != found
            and expected != expected
        )
        return [] if near else [f"{at}: {found!r} instead of {expected!r}"]
    if isinstance(expected, str) and expected.count(" ") >= 2:  # a sentence
        return []
    return [] if str(found) == str(expected) else [f"{at}: {found!r} instead of {expected!r}"]
