"""The results contract: schemas of the tables, and writing them.

A row of a *segment* holds one day and estimator with its FIR and criterion as lists; the tables that
people read (delays, fir, criterion, posterior) are cut from segments.
"""

from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.csv
import pyarrow.parquet as pq

from rivid.atomic import replacing

SCHEMA_VERSION = 1
"""Version of the results contract; a reader refuses a newer one."""

DELAYS = pa.schema(
    [
        ("date", pa.date32()),
        ("reach", pa.string()),
        ("estimator", pa.string()),
        ("status", pa.string()),
        ("delay_samples", pa.float64()),
        ("delay_s", pa.float64()),
        ("at_bound", pa.bool_()),
        ("prior_only", pa.bool_()),
        ("probability", pa.float64()),
        ("delay_low", pa.float64()),
        ("delay_high", pa.float64()),
        ("t50_samples", pa.float64()),
        ("alpha", pa.float64()),
        ("noise_sd", pa.float64()),
        ("roughness_sd", pa.float64()),
        ("output_unit", pa.string()),
        ("criterion", pa.float64()),
        ("iterations", pa.int64()),
        ("condition", pa.float64()),
        ("n_samples", pa.int64()),
        ("n_filled", pa.int64()),
        ("mean_inflow_m3s", pa.float64()),
        ("mean_level_m", pa.float64()),
        ("froude", pa.float64()),
        ("bound_gravity_s", pa.float64()),
        ("bound_kinematic_s", pa.float64()),
        ("message", pa.string()),
    ]
)
"""A row per day and estimator: delays.csv and delays.parquet."""

MEANINGS: dict[str, tuple[str, str]] = {
    "date": ("", "the day; of a data set of several days, the last"),
    "reach": ("", "its name"),
    "estimator": ("", "who answers"),
    "status": ("", "`ok`, `unidentifiable`, `degenerate`, `pending` (today, unfinished) or `failed`"),
    "delay_samples": ("samples", "the delay d; the level first moves at sample d + 1"),
    "delay_s": ("s", "d T_s; of `posterior` the travel time with its fraction, about d T_s to (d + 1) T_s"),
    "at_bound": ("", "the delay is the shortest or longest tried, or lies outside"),
    "prior_only": ("", "the data do not single this delay out; empty where the estimator cannot tell"),
    "probability": ("", "`posterior`: that the likeliest delay is right"),
    "delay_low": ("samples", "`posterior`: shortest of the fewest delays that together hold 90 %"),
    "delay_high": ("samples", "`posterior`: longest of them"),
    "t50_samples": ("samples", "rivers: the lag by which half of a step has arrived"),
    "alpha": ("(m3/s)^2", "regularisation weight, noise over roughness variance"),
    "noise_sd": ("output unit", "sigma_w, standard deviation of the noise"),
    "roughness_sd": ("output unit per m3/s", "sigma_hD, of the response's second differences"),
    "output_unit": ("", "`m` for a level, `m3/s` for a discharge"),
    "criterion": ("", "the least criterion: that of the delay"),
    "iterations": ("", "rounds of Table VI; 0 where there are none"),
    "condition": ("", "condition number of U'U; the paper's days have 2e4 to 1e5"),
    "n_samples": ("samples", "of the data set"),
    "n_filled": ("samples", "of these, that bridge a gap"),
    "mean_inflow_m3s": ("m3/s", "mean inflow"),
    "mean_level_m": ("m", "mean level; empty for a river"),
    "froude": ("", "Froude number (6) at the mean inflow"),
    "bound_gravity_s": ("s", "travel time of a gravity wave (5): the fastest"),
    "bound_kinematic_s": ("s", "travel time of a kinematic wave (5): the slowest"),
    "message": ("", "why there is no answer, and what the reader should know"),
    "lag": ("samples", "fir.parquet: from 0"),
    "value": ("output unit per m3/s", "fir.parquet: the impulse response at this lag"),
    "sd": ("output unit per m3/s", "fir.parquet: its standard deviation, where an estimator gives one"),
}
"""Unit and meaning of each column of the :data:`TABLES`; in Markdown."""

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
"""What workers write: the row, the content key of its day, its FIR, and its whole curve: the criterion of
every candidate delay, CUSUM's g, or the probability."""

TABLES = ("delays.csv", "delays.parquet", "fir.parquet", "criterion.parquet", "posterior.parquet")
"""What :func:`write_tables` writes."""

_FORMULA = ("=", "+", "-", "@", "\t", "\r")


def to_table(columns: dict[str, list[Any]], schema: pa.Schema) -> pa.Table:
    """A table of the schema; a column that is not given is empty, NaN becomes an empty cell."""
    n = len(next(iter(columns.values()), []))
    arrays = []
    for field in schema:
        values = columns.get(field.name)
        if values is None:
            arrays.append(pa.nulls(n, field.type))
        else:
            arrays.append(pa.array(values, field.type, from_pandas=pa.types.is_floating(field.type)))
    return pa.Table.from_arrays(arrays, schema=schema)


def write_parquet(table: pa.Table, path: Path) -> None:
    """Write Parquet atomically, with page checksums: a flipped bit is found on reading."""
    with replacing(path) as scratch:
        pq.write_table(table, scratch, compression="zstd", write_page_checksum=True)


def write_tables(rows: pa.Table, out: Path) -> None:
    """Write the :data:`TABLES`.

    fir.parquet has a column `sd` where an estimator of the run gives the spread of its response;
    posterior.parquet has no row where none gives probabilities.

    Parameters
    ----------
    rows : pyarrow.Table
        Of schema :data:`SEGMENT`, in the order of the tables.
    out : Path
        OUT.
    """
    delays = rows.select(DELAYS.names)
    write_parquet(delays, out / "delays.parquet")
    options = pyarrow.csv.WriteOptions(quoting_style="needed")
    with replacing(out / "delays.csv") as scratch:
        pyarrow.csv.write_csv(_safe_for_spreadsheets(delays), scratch, options)
    lag0 = pa.scalar(0, pa.int64())
    write_parquet(_with_spread(_long(rows, "fir", lag0, "lag", "value"), rows), out / "fir.parquet")
    first = rows["first_candidate"]
    write_parquet(_long(rows, "curve", first, "delay_samples", "criterion"), out / "criterion.parquet")
    sure = rows.filter(rows["probability"].is_valid())
    first = sure["first_candidate"]
    write_parquet(_long(sure, "curve", first, "delay_samples", "probability"), out / "posterior.parquet")


def _with_spread(fir: pa.Table, rows: pa.Table) -> pa.Table:
    """The long table of responses, with their standard deviations where a row has them."""
    given = rows["fir_sd"].is_valid().to_numpy(zero_copy_only=False)
    if not given.any():
        return fir
    lengths = pc.fill_null(pc.list_value_length(rows["fir"]), 0).to_numpy()
    has = np.repeat(given, lengths)
    sd = np.zeros(len(has))
    sd[has] = pc.list_flatten(rows["fir_sd"]).to_numpy()
    return fir.append_column("sd", pa.array(sd, pa.float64(), mask=~has))


def _safe_for_spreadsheets(table: pa.Table) -> pa.Table:
    """Text that a spreadsheet would run as a formula gets an apostrophe in front."""
    column = table["message"].to_pylist()
    safe = ["'" + text if text and text.startswith(_FORMULA) else text for text in column]
    return table.set_column(table.column_names.index("message"), "message", pa.array(safe, pa.string()))


def _long(rows: pa.Table, column: str, first: Any, axis: str, value: str) -> pa.Table:
    """One row per element of a list column: date, reach, estimator, axis, value."""
    lists = rows[column].combine_chunks()
    if isinstance(lists, pa.ChunkedArray):
        lists = (
            pa.concat_arrays(lists.chunks) if lists.num_chunks else pa.array([], SEGMENT.field(column).type)
        )
    lengths = np.diff(lists.offsets.to_numpy()) * ~np.asarray(lists.is_null())
    of_row = np.repeat(np.arange(len(rows)), lengths)
    start = first.as_py() if isinstance(first, pa.Scalar) else first.fill_null(0).to_numpy()
    ends = np.cumsum(lengths)
    position = np.arange(len(of_row)) - np.repeat(ends - lengths, lengths)
    labels = position + (start if np.isscalar(start) else np.asarray(start)[of_row])
    keys = rows.select(["date", "reach", "estimator"]).take(pa.array(of_row))
    return keys.append_column(axis, pa.array(labels, pa.int64())).append_column(value, lists.flatten())
