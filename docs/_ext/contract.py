"""The results contract and the effects, from their homes in the package, and the exit codes."""

import inspect

import pyarrow as pa
from markup import code, table

from rivid.check import flags
from rivid.cli.effects import TITLES, example
from rivid.diagnosis.result import VERDICTS
from rivid.effects import CATALOGUE, FAMILIES, Effect
from rivid.fleet import report as fleet
from rivid.report import diagnosis, forecast
from rivid.results import season, store

TYPES = {"double": "number", "int64": "whole number", "string": "text", "bool": "true or false",
         "date32[day]": "date", "timestamp[ms]": "time", "timestamp[ms, tz=UTC]": "time, UTC"}  # fmt: skip
KEYS = ("date", "reach", "estimator")
_INT, _FLOAT = pa.int64(), pa.float64()

EXIT_CODES: dict[int, tuple[str, str]] = {
    0: ("all well", ""),
    1: ("failure: the disk is full, a file cannot be written", "read the one line on stderr"),
    2: ("usage or configuration", "the line names the option or the key"),
    3: (
        "days failed that had not failed before, or every day failed; all else is written (`--strict`: any)",
        "read `message` of these days; where others are well, tomorrow it is 0 again",
    ),
    10: ("no data", "is DATA_DIR right?"),
    11: ("another run holds OUT", "wait"),
    130: ("interrupted (SIGINT)", "start it again: what is done stays done"),
    143: ("ended (SIGTERM)", "start it again: what is done stays done"),
}
"""What the command line returns: the meaning, and what to do; in Markdown."""


def schemas() -> dict[str, tuple[pa.Schema, dict[str, tuple[str, str]]]]:
    """Every table by name: its columns, and what they mean."""
    keys = [store.DELAYS.field(name) for name in KEYS]
    curve = store.MEANINGS | {
        "delay_samples": ("samples", "a delay that was tried"),
        "criterion": ("", "its criterion; of `posterior` its probability, of CUSUM its g at lag d + 1"),
        "probability": ("", "that this is the delay"),
    }
    return {
        "delays.csv, delays.parquet": (store.DELAYS, store.MEANINGS),
        "fir.parquet": (
            pa.schema([*keys, ("lag", _INT), ("value", _FLOAT), ("sd", _FLOAT)]), store.MEANINGS),
        "criterion.parquet": (
            pa.schema([*keys, ("delay_samples", _INT), ("criterion", _FLOAT)]), curve),
        "posterior.parquet": (
            pa.schema([*keys, ("delay_samples", _INT), ("probability", _FLOAT)]), curve),
        "season.csv, season.parquet": (season.SCHEMA, season.MEANINGS),
        "delay_law.csv": (season.LAW_SCHEMA, season.LAW_MEANINGS),
        "fleet.csv, fleet.parquet": (fleet.FLEET, fleet.MEANINGS),
        "unexplained_inflow.parquet": (diagnosis.SCHEMA, diagnosis.MEANINGS),
        "forecast.csv, forecast.parquet": (forecast.SCHEMA, forecast.MEANINGS),
        "flags.csv, flags.parquet": (flags.SCHEMA, flags.MEANINGS),
    }  # fmt: skip


def results(names: tuple[str, ...] = ()) -> str:
    """The columns of the tables, or of those of these names."""
    parts = []
    for name, (schema, meanings) in schemas().items():
        if names and name not in names:
            continue
        rows = [
            [code(f.name), TYPES[str(f.type)], meanings[f.name][0],
             meanings[f.name][1].removeprefix("fir.parquet: ")] for f in schema
        ]  # fmt: skip
        heading = " and ".join(code(one) for one in name.split(", "))
        parts.append(f"## {heading}\n\n{table(['column', 'type', 'unit', 'meaning'], rows)}")
    return "\n".join(parts)


def exits() -> str:
    """What the command line returns."""
    rows = ([code(str(number)), *meaning] for number, meaning in EXIT_CODES.items())
    return table(["code", "meaning", "what to do"], rows)


def verdicts() -> str:
    """What a diagnosis may answer."""
    return table(["verdict", "in words"], ([code(name), meaning] for name, meaning in VERDICTS.items()))


def effects() -> str:
    """The catalogue."""
    parts = []
    for family in FAMILIES:
        parts.append(f"## {TITLES[family]}\n")
        parts += [effect(one) for one in CATALOGUE.values() if one.family == family]
    return "\n".join(parts)


def effect(one: type[Effect]) -> str:
    """One effect: what it is, its equation, its parameters, what it looks like, a table for a scenario."""
    usual = one.defaults()
    rows = []
    for key, spec in one.parameters().items():
        value = usual[key]
        shown = code(str(list(value)) if isinstance(value, tuple) else f"{value:g}")
        many = "; or a list" if spec.many and value != () else ""
        unit = "" if spec.unit == "-" else spec.unit
        rows.append([code(key), unit, shown, f"{spec.low:g} to {spec.high:g}", spec.meaning + many])
    when = "May be limited to dates and hours." if one.windowed else "Always there: takes no dates and hours."
    heads = ["parameter", "unit", "usual", "limits", "meaning"]
    return "\n".join(
        [f"### `{one.name}`\n", one.sentence, "", *(f"{text}\n" for text in _paragraphs(one)),
         table(heads, rows), f"{when} **Looks like:** {one.looks}\n", "```toml", example(one), "```\n"]
    )  # fmt: skip


def _paragraphs(one: type[Effect]) -> list[str]:
    doc = inspect.cleandoc(one.__doc__ or "").split("\n\nParameters\n")[0]
    if doc.startswith(f"{one.__name__}("):  # by dataclass, for want of any
        return []
    return [text.replace("``", "`") for text in doc.split("\n\n") if text]
