"""One exported file, read as declared: text of any dialect, or Parquet."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from rivid.errors import DataError
from rivid.logs import arrow as csvfast
from rivid.logs.files import MANY, read_bytes, refuse_rows, refuse_size, shown
from rivid.logs.header import (
    LINE,
    Columns,
    Header,
    Seen,
    UndeclaredError,
    check_names,
    cut_footer,
    plain_bytes,
    read_odd_header,
    split_cells,
)
from rivid.logs.sniff.columns import looks_like_flags, unit_said
from rivid.logs.spec import Spec
from rivid.logs.text import LongReader, WideReader, read_long, read_tolerant

LONGEST = 200
"""Characters of a cell of Parquet."""


@dataclass(frozen=True)
class Export:
    """A file, read.

    Attributes
    ----------
    name : str
        How messages call it.
    parts : list of Columns
        One of the wide layout, one per tag of the long.
    seen : Seen
    lacking : str
        What to say where it has nothing that is asked for.
    """

    name: str
    parts: list[Columns]
    seen: Seen
    lacking: str = ""


def read_export(path: Path, spec: Spec) -> Export:
    """Read an export.

    Parameters
    ----------
    path : Path
        Text (of any ending; gzipped where it ends in .gz), or Parquet.
    spec : Spec

    Returns
    -------
    Export

    Raises
    ------
    UndeclaredError
        Where it is not as declared; the message says what to declare.
    DataError
        Where it cannot be read.
    """
    name = shown(path.name)
    content, _ = read_bytes(path, name, MANY)
    stem = stem_of(path.name)
    if content[:4] == b"PAR1":
        return _of_parquet(content, spec, name, stem)
    content = plain_bytes(content, spec, name)
    refuse_rows(name, content.count(b"\n"), MANY)
    try:
        header = read_odd_header(content, spec, name, some=True)
        content, footers = cut_footer(content, header, spec)
        if spec.dialect.long:
            long = read_long(content, header, spec, name, stem, watch=True)
            export = Export(name, long.tags, long.seen, long.lacking)
        else:
            export = _wide(_wide_columns(content, header, spec, name), name)
            export.seen.units.update(_unit_cells(content, header, spec))
        export.seen.footers = footers
    except UnicodeDecodeError:
        raise UndeclaredError(f"{name}: not {spec.encoding}: set [input] encoding") from None
    _refuse_flags(export, spec)
    _refuse_units(export, spec)
    return export


def _wide_columns(content: bytes, header: Header, spec: Spec, name: str) -> Columns:
    """The quick reader where it tells as much: all columns are read and no cell is empty."""
    if set(header.names) == {*spec.time, *spec.sources}:
        columns = csvfast.read_fast(content, header, spec)
        if columns is not None and not any((v != v).any() for v in columns.numbers.values()):
            columns.seen.rows = len(columns.times)
            return columns
    return read_tolerant(content, header, spec, name, watch=True)


def _unit_cells(content: bytes, header: Header, spec: Spec) -> dict[str, str]:
    """What the rows of units say of each source."""
    above = LINE.split(content[: header.body].decode("utf-8", "replace").rstrip("\r\n"))
    rows = [split_cells(line, spec.separator) or [] for line in above[len(above) - spec.unit_rows :]]
    units = {}
    for source in set(spec.sources) & set(header.names):
        at = header.names.index(source)
        units[source] = next((row[at] for row in rows if at < len(row) and row[at]), "")
    return units


def _wide(columns: Columns, name: str) -> Export:
    if len(columns.times):
        return Export(name, [columns], columns.seen)
    lacking = columns.bad[0].text if columns.bad else "a header and no rows"
    return Export(name, [], columns.seen, lacking)


def stem_of(name: str) -> str:
    """A file's name without its endings: the tag, where nothing else tells it."""
    plain = name[:-3] if name.lower().endswith(".gz") else name
    return plain.rpartition(".")[0] or plain


def _refuse_flags(export: Export, spec: Spec) -> None:
    """Flags that are not declared would be passed over, and what they doubt taken as measured."""
    read = {*spec.sources, spec.dialect.value}
    for column, texts in export.seen.cells.items():
        if column in spec.dialect.ignore or not looks_like_flags(column, texts, read):
            continue
        few = ", ".join(repr(text[:20]) for text in sorted(texts or ())[:6])
        where = (
            f"column {column!r} ({few}{', ...' if texts and len(texts) > 6 else ''}) may hold flags or zones"
        )
        raise UndeclaredError(
            f"{export.name}: {where}: set [input] quality and good, or zone_column; "
            f"if it is neither, ignore = [{column!r}]"
        )


def _refuse_units(export: Export, spec: Spec) -> None:
    """A unit that the file states and the configuration does not would be a factor in the values."""
    present = {name for columns in export.parts for name in columns.numbers}
    for signal in spec.signals:
        if signal.name in spec.dialect.units:
            continue
        level = signal.name == "h_L"
        for source in signal.sources:
            unit = unit_said(source, export.seen.units.get(source, ""), level=level)
            if source in present and unit and unit != ("m" if level else "m3/s"):
                raise UndeclaredError(
                    f"{export.name}: {source!r} seems to be in {unit}: set [input.units] "
                    f'{signal.name} = "{unit}", or to what it is'
                )


def _of_parquet(content: bytes, spec: Spec, name: str, stem: str) -> Export:
    """Parquet as rows of texts: so flags, tags and zones are read by the same rules as in text files."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        limit = {"thrift_string_size_limit": 16 << 20, "thrift_container_size_limit": 200_000}
        file = pq.ParquetFile(pa.BufferReader(content), page_checksum_verification=True, **limit)
        metadata = file.metadata
        refuse_rows(name, metadata.num_rows, MANY)
        groups = range(metadata.num_row_groups)
        refuse_size(name, sum(max(metadata.row_group(i).total_byte_size, 0) for i in groups), MANY)
        names = tuple(file.schema_arrow.names)
        check_names(names, spec, name, some=True)
        table = file.read(use_threads=False)
        texts = [_texts(table.column(i), spec) for i in range(len(names))]
    except (pa.ArrowException, OSError, ValueError, KeyError, TypeError, MemoryError) as error:
        raise DataError(f"{name} is a damaged Parquet file: {' '.join(str(error).split())[:200]}") from None
    kinds = {str(table.schema.field(column).type) for column in spec.time}
    if all(kind.startswith("timestamp") for kind in kinds):
        spec = replace(spec, time_format=None)
    header = Header(names, 0, 0)
    reader = LongReader(header, spec, stem, True) if spec.dialect.long else WideReader(header, spec, True)
    for number, cells in enumerate(zip(*texts, strict=True), 1):
        reader.seen.rows += 1
        reader.row(number, list(cells))
    if isinstance(reader, LongReader):
        long = reader.told()
        export = Export(name, long.tags, long.seen, long.lacking)
    else:
        export = _wide(reader.columns(), name)
    export.parts[:] = [
        replace(columns, unit="row", bad=[b._replace(text="row" + b.text[4:]) for b in columns.bad])
        for columns in export.parts
    ]
    _refuse_flags(export, spec)
    _refuse_units(export, spec)
    return export


def _texts(column: Any, spec: Spec) -> list[str]:
    cells = column.to_pylist()
    texts = []
    for cell in cells:
        if cell is None:
            text = ""
        elif isinstance(cell, float):
            text = "" if cell != cell else repr(cell).replace(".", spec.decimal)
        else:
            text = cell.isoformat() if hasattr(cell, "isoformat") else str(cell)
        if len(text) > LONGEST:
            raise ValueError(f"a cell is {len(text):,} characters long")
        texts.append(text.strip())
    return texts
