"""The tables of OUT from the rows of its segments, a chunk at a time, so that memory stays as it is."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.csv
import pyarrow.parquet as pq

from rivid.atomic import replacing
from rivid.results.rows import Rows, whole_numbers
from rivid.results.tables import DELAYS

Write = Callable[[pa.Table], None]
FORMULA = ("=", "+", "-", "@", "\t", "\r")
"""How a text begins that a spreadsheet takes for a formula."""


def write_merged(rows: Rows, out: Path) -> None:
    """Write the :data:`rivid.results.tables.TABLES`.

    fir.parquet has a column `sd` where an estimator of the run gives the spread of its response;
    posterior.parquet has no row where none gives probabilities.

    Parameters
    ----------
    rows : Rows
        In the order of the tables.
    out : Path
        OUT.

    Notes
    -----
    Each chunk of rows is a row group of delays.parquet; the rows alone decide the bytes.
    """
    with ExitStack() as open_files:
        delays = open_files.enter_context(_parquet(out / "delays.parquet"))
        text = open_files.enter_context(_csv(out / "delays.csv"))
        fir = open_files.enter_context(_parquet(out / "fir.parquet"))
        criterion = open_files.enter_context(_parquet(out / "criterion.parquet"))
        posterior = open_files.enter_context(_parquet(out / "posterior.parquet"))
        for chunk in rows.chunks():
            short = chunk.select(DELAYS.names)
            delays(short)
            text(safe_for_spreadsheets(short))
            responses = _long(chunk, "fir", None, "lag", "value")
            fir(_with_spread(responses, chunk) if rows.spread else responses)
            criterion(_long(chunk, "curve", "first_candidate", "delay_samples", "criterion"))
            sure = chunk.filter(chunk["probability"].is_valid())
            posterior(_long(sure, "curve", "first_candidate", "delay_samples", "probability"))


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


def _with_spread(responses: pa.Table, rows: pa.Table) -> pa.Table:
    """The long table of responses, with their standard deviations; empty where a row has none."""
    lengths = pc.fill_null(pc.list_value_length(rows["fir"]), 0).to_numpy()
    has = np.repeat(rows["fir_sd"].is_valid().to_numpy(), lengths)
    place = np.where(has, np.cumsum(has) - 1, -1)
    given = pc.list_flatten(rows["fir_sd"]).combine_chunks()
    where = pc.if_else(pc.less(whole_numbers(place), 0), pa.scalar(None, pa.int64()), whole_numbers(place))
    return responses.append_column("sd", given.take(where))


def safe_for_spreadsheets(table: pa.Table, columns: Sequence[str] = ("message",)) -> pa.Table:
    """Text that a spreadsheet would run as a formula gets an apostrophe in front."""
    for name in columns:
        index = table.column_names.index(name)
        cells = table.column(index).to_pylist()
        safe = ["'" + text if text and text.startswith(FORMULA) else text for text in cells]
        table = table.set_column(index, name, pa.array(safe, pa.string()))
    return table


@contextmanager
def _parquet(path: Path) -> Iterator[Write]:
    """A Parquet file that grows by tables; it takes its place when all are written."""
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


@contextmanager
def _csv(path: Path) -> Iterator[Write]:
    """A CSV file that grows by tables."""
    options = pyarrow.csv.WriteOptions(quoting_style="needed")
    with replacing(path) as scratch:
        with pyarrow.csv.CSVWriter(scratch, DELAYS, write_options=options) as writer:
            yield writer.write_table
