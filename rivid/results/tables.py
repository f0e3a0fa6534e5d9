"""The results contract: schemas of the tables, and writing them.

A row of a *segment* holds one day and estimator with its FIR and criterion as lists; the tables of OUT
(delays, fir, criterion, posterior) are made from segments, a chunk of rows at a time.
"""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.csv
import pyarrow.parquet as pq
from numpy.typing import NDArray

from rivid.atomic import replacing
from rivid.errors import RividError
from rivid.types import Bools, Floats

SCHEMA_VERSION = 1
"""Version of the results contract; a reader refuses a newer one."""


def described(
    columns: Sequence[tuple[str, pa.DataType, str, str]],
) -> tuple[pa.Schema, dict[str, tuple[str, str]]]:
    """The schema of columns (name, type, unit, meaning), and unit and meaning of each."""
    schema = pa.schema([(name, kind) for name, kind, _, _ in columns])
    return schema, {name: (unit, meaning) for name, _, unit, meaning in columns}


DATE, TEXT, NUMBER, WHOLE, FLAG = pa.date32(), pa.string(), pa.float64(), pa.int64(), pa.bool_()


def refuse_newer(record: dict[str, Any], out: Path) -> None:
    """Raise RividError where a newer rivid wrote this run.json of OUT: its tables may differ."""
    if record["schema_version"] > SCHEMA_VERSION:
        raise RividError(
            f"{out} was written by a newer rivid (schema {record['schema_version']}, this one knows "
            f"{SCHEMA_VERSION}): upgrade rivid, or give another OUT"
        )


DELAYS, MEANINGS = described(
    [
        ("date", DATE, "", "the day; of a data set of several days, the last"),
        ("reach", TEXT, "", "name of the reach"),
        ("estimator", TEXT, "", "its name"),
        (
            "status",
            TEXT,
            "",
            "`ok`, `unidentifiable`, `degenerate`, `pending` (today, unfinished) or `failed`",
        ),
        ("delay_samples", NUMBER, "samples", "the delay d; the level first moves at sample d + 1"),
        (
            "delay_s",
            NUMBER,
            "s",
            "d T_s; of `posterior` the travel time with its fraction, about d T_s to (d + 1) T_s",
        ),
        ("at_bound", FLAG, "", "the delay is the shortest or longest tried, or lies outside"),
        (
            "prior_only",
            FLAG,
            "",
            "the data do not single this delay out; empty where the estimator cannot decide that",
        ),
        ("probability", NUMBER, "", "`posterior`: that the likeliest delay is right"),
        (
            "delay_low",
            NUMBER,
            "samples",
            "`posterior`: shortest of the fewest delays that together hold 90 %",
        ),
        ("delay_high", NUMBER, "samples", "`posterior`: longest of them"),
        ("t50_samples", NUMBER, "samples", "rivers: the lag by which half of a step has arrived"),
        ("alpha", NUMBER, "(m3/s)^2", "regularisation weight, noise over roughness variance"),
        ("noise_sd", NUMBER, "output unit", "sigma_w, standard deviation of the noise"),
        ("roughness_sd", NUMBER, "output unit per m3/s", "sigma_hD, of the response's second differences"),
        ("output_unit", TEXT, "", "`m` for a level, `m3/s` for a discharge"),
        ("criterion", NUMBER, "", "the least criterion: that of the delay"),
        ("iterations", WHOLE, "", "rounds of Table VI; 0 where there are none"),
        ("condition", NUMBER, "", "condition number of U'U; the paper's days have 2e4 to 1e5"),
        ("n_samples", WHOLE, "samples", "of the data set"),
        ("n_filled", WHOLE, "samples", "of these, that bridge a gap"),
        ("mean_inflow_m3s", NUMBER, "m3/s", "mean inflow"),
        ("mean_level_m", NUMBER, "m", "mean level; empty for a river"),
        ("froude", NUMBER, "", "Froude number (6) at the mean inflow"),
        ("bound_gravity_s", NUMBER, "s", "travel time of a gravity wave (5): the fastest"),
        ("bound_kinematic_s", NUMBER, "s", "travel time of a kinematic wave (5): the slowest"),
        ("message", TEXT, "", "why there is no answer, and remarks on the day"),
    ]
)
"""A row per day and estimator: delays.csv and delays.parquet; units and meanings, in Markdown."""

MEANINGS |= {
    "lag": ("samples", "fir.parquet: from 0"),
    "value": ("output unit per m3/s", "fir.parquet: the impulse response at this lag"),
    "sd": ("output unit per m3/s", "fir.parquet: its standard deviation, where an estimator gives one"),
}

SEGMENT = pa.schema(
    [
        ("key", pa.string()),
        *DELAYS,
        ("fir", pa.list_(pa.float64())),
        ("fir_sd", pa.list_(pa.float64())),
        ("first_candidate", pa.int64()),
        ("curve", pa.list_(pa.float64())),
    ]
)
"""Rows that workers write: content key of the day, row of delays.csv, FIR, and the criterion of every
candidate delay (of CUSUM its g, of posteriors the probability)."""

TABLES = ("delays.csv", "delays.parquet", "fir.parquet", "criterion.parquet", "posterior.parquet")
"""Files of :func:`write_tables`."""

FORMULA = ("=", "+", "-", "@", "\t", "\r")
"""First characters of a cell that a spreadsheet evaluates as a formula."""


def to_table(columns: Mapping[str, "list[Any] | pa.Array"], schema: pa.Schema) -> pa.Table:
    """A table of the schema; a column that is not given is empty, NaN becomes an empty cell."""
    n = len(next(iter(columns.values()), []))
    arrays = []
    for field in schema:
        values = columns.get(field.name)
        if values is None:
            arrays.append(pa.nulls(n, field.type))
        elif isinstance(values, pa.Array):
            arrays.append(values)
        else:
            arrays.append(pa.array(values, field.type, from_pandas=pa.types.is_floating(field.type)))
    return pa.Table.from_arrays(arrays, schema=schema)


def lists(values: Floats, given: Bools) -> pa.Array:
    """A column with, as cells, the rows of `values`, shape (n, width); empty where not `given`, (n,)."""
    flat = np.ascontiguousarray(values[given], np.float64)
    ends = np.cumsum(given * values.shape[1]).tolist()
    starts = [start if is_given else None for start, is_given in zip([0, *ends], given, strict=False)]
    offsets = pa.array([*starts, ends[-1] if ends else 0], pa.int32())
    return pa.ListArray.from_arrays(
        offsets, pa.Array.from_buffers(pa.float64(), flat.size, [None, pa.py_buffer(flat)])
    )


def finite(row: dict[str, Any]) -> dict[str, Any]:
    """A row for JSON, which has no NaN and no infinity: null in their place."""
    return {k: None if isinstance(v, float) and not math.isfinite(v) else v for k, v in row.items()}


def write_parquet(table: pa.Table, path: Path) -> None:
    """Write Parquet atomically, with page checksums: a flipped bit is found on reading."""
    with replacing(path) as scratch:
        pq.write_table(table, scratch, compression="zstd", write_page_checksum=True)


def write_csv(table: pa.Table, path: Path) -> None:
    """Write CSV atomically."""
    with replacing(path) as scratch:
        pyarrow.csv.write_csv(table, scratch, pyarrow.csv.WriteOptions(quoting_style="needed"))


def safe_for_spreadsheets(table: pa.Table, columns: Sequence[str] = ("message",)) -> pa.Table:
    """Prefix text that a spreadsheet would evaluate as a formula with an apostrophe."""
    for name in columns:
        index = table.column_names.index(name)
        cells = table.column(index).to_pylist()
        safe = ["'" + text if text and text.startswith(FORMULA) else text for text in cells]
        table = table.set_column(index, name, pa.array(safe, pa.string()))
    return table


def write_tables(chunks: Iterable[pa.Table], out: Path, spread: bool) -> None:
    """Write the :data:`TABLES`, each atomically; posterior.parquet has the rows with probabilities.

    `chunks` are rows of schema :data:`SEGMENT` in the order of the tables; each becomes a row group of
    delays.parquet. With `spread`, fir.parquet has a column `sd`, the standard deviation of the response.
    """
    with ExitStack() as files:
        delays, fir, criterion, posterior = (
            files.enter_context(_growing(out / f"{name}.parquet"))
            for name in ("delays", "fir", "criterion", "posterior")
        )
        scratch = files.enter_context(replacing(out / "delays.csv"))
        options = pyarrow.csv.WriteOptions(quoting_style="needed")
        text = files.enter_context(pyarrow.csv.CSVWriter(scratch, DELAYS, write_options=options))
        for chunk in chunks:
            short = chunk.select(DELAYS.names)
            delays(short)
            text.write_table(safe_for_spreadsheets(short))
            responses = _long(chunk, "fir", None, "lag", "value")
            fir(_with_sd(responses, chunk) if spread else responses)
            criterion(_long(chunk, "curve", "first_candidate", "delay_samples", "criterion"))
            sure = chunk.filter(chunk["probability"].is_valid())
            posterior(_long(sure, "curve", "first_candidate", "delay_samples", "probability"))


@contextmanager
def _growing(path: Path) -> Iterator[Callable[[pa.Table], None]]:
    """A Parquet file that grows by tables; it replaces the old one when all are written."""
    with replacing(path) as scratch, ExitStack() as stack:
        writers: list[pq.ParquetWriter] = []
        empty: list[pa.Table] = []

        def write(table: pa.Table) -> None:
            if not writers:
                writer = pq.ParquetWriter(scratch, table.schema, compression="zstd", write_page_checksum=True)
                writers.append(stack.enter_context(writer))
                empty.append(table.slice(0, 0))
            if len(table):
                writers[0].write_table(table)
                empty.clear()

        yield write
        for table in empty:  # a file without rows has one row group all the same
            writers[0].write_table(table)
        stack.close()


def _long(rows: pa.Table, column: str, first: str | None, axis: str, value: str) -> pa.Table:
    """A row per element of a list column: date, reach, estimator, axis, value; the axis begins at `first`."""
    lists = rows[column].combine_chunks()
    lengths = pc.fill_null(pc.list_value_length(lists), 0).to_numpy(zero_copy_only=False)
    of_row = np.repeat(np.arange(len(rows)), lengths)
    labels = np.arange(len(of_row)) - np.repeat(np.cumsum(lengths) - lengths, lengths)
    if first is not None:
        labels += pc.fill_null(rows[first], 0).to_numpy()[of_row]
    keys = rows.select(["date", "reach", "estimator"]).take(whole_numbers(of_row))
    return keys.append_column(axis, whole_numbers(labels)).append_column(value, pc.list_flatten(lists))


def _with_sd(responses: pa.Table, rows: pa.Table) -> pa.Table:
    """The long table of responses, with their standard deviations; empty where a row has none."""
    lengths = pc.fill_null(pc.list_value_length(rows["fir"]), 0).to_numpy()
    has = np.repeat(rows["fir_sd"].is_valid().to_numpy(), lengths)
    place = whole_numbers(np.where(has, np.cumsum(has) - 1, -1))
    given = pc.list_flatten(rows["fir_sd"]).combine_chunks()
    where = pc.if_else(pc.less(place, 0), pa.scalar(None, pa.int64()), place)
    return responses.append_column("sd", given.take(where))


def whole_numbers(values: NDArray[np.int64]) -> pa.Array:
    """An Arrow array of integers; ``pa.array`` of a numpy array would import numpy.ma to check for a mask."""
    values = np.ascontiguousarray(values, np.int64)
    return pa.Array.from_buffers(pa.int64(), len(values), [None, pa.py_buffer(values)])
