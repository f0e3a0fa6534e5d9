"""Read a file into a log, or give it as read before."""

from collections import OrderedDict
from pathlib import Path

from rivid.errors import DataError
from rivid.logs import csvfast, csvtext
from rivid.logs.files import Limits, read_bytes, refuse_rows, suffix_of
from rivid.logs.footer import cut_footer
from rivid.logs.header import plain_bytes, read_header, read_odd_header
from rivid.logs.log import Log, make_log
from rivid.logs.spec import Spec

_kept: OrderedDict[tuple[object, ...], Log] = OrderedDict()
KEPT_FILES, KEPT_ROWS = 40, 1_000_000
"""Files and rows that a process keeps read, as windows share days; two files stay in any case."""


def load(path: Path, name: str, spec: Spec, limits: Limits, *, fresh: bool = False) -> Log:
    """Read a file of one day (limits `DAY`) or of many (:data:`MANY`), or give it as read before.

    Parameters
    ----------
    path : Path
    name : str
        How messages call it.
    spec : Spec
    limits : Limits
    fresh : bool
        Read it in any case: within the clock's tick a changed file may look unchanged.

    Returns
    -------
    Log

    Raises
    ------
    DataError
        Where nothing of the file can be used; CutError where it ends too early.
    """
    try:
        status = path.stat()
    except OSError as error:
        raise DataError(f"{name} cannot be read: {error.strerror}") from None
    key = (path, status.st_ino, status.st_size, status.st_mtime_ns, status.st_ctime_ns, spec)
    log = None if fresh else _kept.get(key)
    if log is None:
        log = _kept[key] = _parse(path, name, spec, limits)
        while len(_kept) > KEPT_FILES or (
            len(_kept) > 2 and sum(len(kept.times) for kept in _kept.values()) > KEPT_ROWS
        ):
            _kept.popitem(last=False)
    else:
        _kept.move_to_end(key)
    return log


def _parse(path: Path, name: str, spec: Spec, limits: Limits) -> Log:
    content, digest = read_bytes(path, name, limits)
    if suffix_of(path.name) == ".parquet":
        from rivid.logs.parquet import read_parquet

        if spec.dialect.quality or spec.dialect.zone_column:
            raise DataError(
                f"{name}: flags and zones of Parquet are read by `rivid ingest` only: use that first"
            )

        return make_log(read_parquet(content, spec, name, limits), spec, name, digest)
    content = plain_bytes(content, spec, name)
    refuse_rows(name, content.count(b"\n"), limits)
    header = (read_header if spec.dialect.plain else read_odd_header)(content, spec, name)
    content, footers = cut_footer(content, header, spec)
    columns = csvfast.read_fast(content, header, spec)
    if columns is None:
        columns = csvtext.read_tolerant(content, header, spec, name)
    if footers:
        columns.dropped["footer rows"] = [len(columns.times)] * footers
    return make_log(columns, spec, name, digest)
