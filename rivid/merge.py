"""The tables of OUT from the rows of its segments, a chunk at a time, so that memory stays as it is."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet as pq

from rivid import tables
from rivid.atomic import replacing
from rivid.rows import CHUNK, Rows
from rivid.tables import DELAYS, write_tables

Write = Callable[[pa.Table], None]


def write_merged(rows: Rows, out: Path) -> None:
    """Write the :data:`rivid.tables.TABLES`.

    Parameters
    ----------
    rows : Rows
        In the order of the tables.
    out : Path
        OUT.

    Notes
    -----
    Up to :data:`rivid.rows.CHUNK` rows the files are those of :func:`rivid.tables.write_tables`; beyond, each
    chunk is a row group of its own. Either way the rows alone decide the bytes.
    """
    chunks = rows.chunks()
    if len(rows) <= CHUNK:
        write_tables(next(chunks), out)
        return
    with ExitStack() as open_files:
        delays = open_files.enter_context(_parquet(out / "delays.parquet"))
        text = open_files.enter_context(_csv(out / "delays.csv"))
        fir = open_files.enter_context(_parquet(out / "fir.parquet"))
        criterion = open_files.enter_context(_parquet(out / "criterion.parquet"))
        posterior = open_files.enter_context(_parquet(out / "posterior.parquet"))
        for chunk in chunks:
            short = chunk.select(DELAYS.names)
            delays(short)
            text(tables._safe_for_spreadsheets(short))
            lag0 = pa.scalar(0, pa.int64())
            responses = tables._with_spread(tables._long(chunk, "fir", lag0, "lag", "value"), chunk)
            if rows.spread and "sd" not in responses.column_names:
                responses = responses.append_column("sd", pa.nulls(len(responses), pa.float64()))
            fir(responses)
            criterion(tables._long(chunk, "curve", chunk["first_candidate"], "delay_samples", "criterion"))
            sure = chunk.filter(chunk["probability"].is_valid())
            posterior(tables._long(sure, "curve", sure["first_candidate"], "delay_samples", "probability"))


@contextmanager
def _parquet(path: Path) -> Iterator[Write]:
    """A Parquet file that grows by tables; it takes its place when all are written."""
    with replacing(path) as scratch, ExitStack() as stack:
        writers: list[pq.ParquetWriter] = []

        def write(table: pa.Table) -> None:
            if not writers:
                writer = pq.ParquetWriter(scratch, table.schema, compression="zstd", write_page_checksum=True)
                writers.append(stack.enter_context(writer))
            if len(table):
                writers[0].write_table(table)

        yield write
        stack.close()


@contextmanager
def _csv(path: Path) -> Iterator[Write]:
    """A CSV file that grows by tables."""
    options = pyarrow.csv.WriteOptions(quoting_style="needed")
    with replacing(path) as scratch:
        with pyarrow.csv.CSVWriter(scratch, DELAYS, write_options=options) as writer:
            yield writer.write_table
