"""Formats of the field as text: netCDF-CF, PI-XML, WaterML 2, the OGC API's JSON, workbooks, HEC-DSS.

Each file becomes a table in CSV, which `rivid sniff` and `rivid ingest` read like any other export: a
workbook as its rows stand, all others with a row for each value, of its time, tag, value, unit and flag.
Values that a format declares missing have an empty cell. The libraries of the binary formats come with
``rivid[formats]``.
"""

import csv
import datetime as dt
import io
import json
import re
import tempfile
import xml.etree.ElementTree as ET
import zipfile
from collections.abc import Callable, Iterator, Sequence
from importlib import import_module
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from rivid.errors import DataError
from rivid.logs.spec import MANY, refuse_rows, refuse_size

# columns of the tables that are not of a workbook; `flag` where there are flags
HEADER = ("time", "tag", "value", "unit", "flag")
Rows = Iterator[Sequence[Any]]


def as_text(content: bytes, name: str) -> bytes:
    """The content of an unpacked export as UTF-8: the table of a file of a known format; any other as it is.

    `name` is the file, in messages. DataError where the file is damaged, holds no values or too many, or its
    library is not installed.
    """
    kind = next((kind for kind, (is_of, _) in FORMATS.items() if is_of(content)), None)
    if kind is None:
        return content
    try:
        rows = list(islice(FORMATS[kind][1](content), MANY[1] + 1))
    except ModuleNotFoundError as error:
        raise DataError(f"{name} is {kind}: reading it needs pip install 'rivid[formats]'") from error
    except Exception as error:  # libraries raise what they like on a damaged file
        raise DataError(f"{name} is not sound {kind}: {str(error)[:200]}") from error
    refuse_rows(name, len(rows), MANY[1])
    if not rows:
        raise DataError(f"{name} is {kind} without values: expected one value or more")
    if kind != "a workbook":
        width = len(HEADER) if any(row[-1] for row in rows) else len(HEADER) - 1
        rows = [HEADER[:width], *(row[:width] for row in rows)]
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(rows)
    return text.getvalue().encode()


def _attribute(element: ET.Element | None, *names: str) -> str:
    """The first of these attributes that an element has, without namespaces; empty without element."""
    found = {} if element is None else {key.rpartition("}")[2]: text for key, text in element.attrib.items()}
    return next((found[name] for name in names if found.get(name)), "")


def _pi_xml(content: bytes) -> Rows:
    """Delft-FEWS PI-XML: times in the zone that the file states in hours, flags of 0 to 9."""
    root = ET.fromstring(content)
    zone = dt.timezone(dt.timedelta(hours=float(root.findtext(".//{*}timeZone") or "0")))
    for series in root.iterfind(".//{*}series"):
        entries = series.iterfind("{*}header/*")
        header = {each.tag.rpartition("}")[2]: (each.text or "").strip() for each in entries}
        names = ("locationId", "parameterId", "qualifierId", "ensembleMemberIndex")
        tag = " ".join(header[name] for name in names if header.get(name))
        missing = float(header.get("missVal") or "nan")
        for event in series.iterfind("{*}event"):
            at = dt.datetime.fromisoformat(f"{event.get('date')}T{event.get('time')}").replace(tzinfo=zone)
            value = event.get("value", "")
            there = value and float(value) != missing
            yield at.isoformat(), tag, value if there else "", header.get("units"), event.get("flag")


def _waterml(content: bytes) -> Rows:
    """WaterML 2: each series has the names of its place and of what was observed."""
    top = ET.Element("")
    top.append(ET.fromstring(content))
    for one in top.iterfind(".//{*}OM_Observation"):
        parts = (one.find(f".//{{*}}{kind}") for kind in ("featureOfInterest", "observedProperty"))
        tag = " ".join(_attribute(part, "title", "href").rsplit("/", 1)[-1] for part in parts).strip()
        default = next(one.iterfind(".//{*}DefaultTVPMeasurementMetadata"), one)
        unit = _attribute(default.find(".//{*}uom"), "code", "title", "href")
        usual = _flag(default)
        for point in one.iterfind(".//{*}MeasurementTVP"):
            time, value = (next(point.iterfind(f"{{*}}{kind}")).text for kind in ("time", "value"))
            yield time, tag, value, unit, _flag(point) or usual


def _flag(element: ET.Element) -> str:
    """The qualifier within an element, else the quality."""
    found = (element.find(f".//{{*}}{kind}") for kind in ("qualifier", "quality"))
    return _attribute(next((each for each in found if each is not None), None), "title", "href")


def _ogc_json(content: bytes) -> Rows:
    """Features of the OGC API that the USGS serves: a feature for each value."""
    for feature in json.loads(content)["features"]:
        of = feature["properties"]
        names = (of.get(key) for key in ("monitoring_location_id", "parameter_code", "statistic_id"))
        flags = (of.get("approval_status"), *np.atleast_1d(of.get("qualifier") or []))
        tag, flag = (" ".join(str(each) for each in texts if each) for texts in (names, flags))
        yield of["time"], tag, of["value"], of.get("unit_of_measure"), flag


def _netcdf(content: bytes) -> Rows:
    """netCDF with the CF conventions: variables in time, alone or by station; times are UTC."""
    engine = "scipy" if content.startswith(b"CDF") else "h5netcdf"
    with import_module("xarray").open_dataset(io.BytesIO(content), engine=engine) as data:
        refuse_size("its content", data.nbytes, MANY[0])  # compressed, it may be any size
        axes = [axis for name in data.variables if (axis := data[name]).dtype.kind == "M" and axis.ndim == 1]
        for name, values in data.data_vars.items():
            axis = next((each for each in axes if each.dims[0] in values.dims), None)
            if axis is None or values.dtype.kind not in "fiu":
                continue
            where = [dim for dim in values.dims if dim != axis.dims[0]]
            if len(where) > 1:
                came = ", ".join(values.dims)
                raise ValueError(f"{name} has the dimensions {came}: expected time and one more at most")
            times = [f"{time}Z" for time in np.datetime_as_string(axis.values.astype("M8[ms]"))]
            places = _stations(data, where[0]) if where else [""]
            table = values.transpose(*where, axis.dims[0]).values.reshape(len(places), -1)
            for place, series in zip(places, table.tolist(), strict=True):
                tag, unit = f"{place} {name}".strip(), values.attrs.get("units", "")
                for time, value in zip(times, series, strict=True):
                    yield time, tag, "" if value != value else value, unit, ""


def _stations(data: Any, dim: str) -> list[str]:
    """The names of the stations along a dimension: by cf_role, else by their number."""
    roles = [name for name in data.variables if data[name].attrs.get("cf_role") == "timeseries_id"]
    names = [name for name in (*roles, dim) if name in data.variables and data[name].dims == (dim,)]
    values = data[names[0]].values if names else np.arange(data.sizes[dim])
    return [each.decode() if isinstance(each, bytes) else str(each) for each in values.tolist()]


def _workbook(content: bytes) -> Rows:
    """Excel and OpenDocument: the longest sheet, and below it those with the same first row."""
    library = import_module("python_calamine")
    if content.startswith(ZIP):
        with zipfile.ZipFile(io.BytesIO(content)) as parts:
            refuse_size("its content", sum(part.file_size for part in parts.infolist()), MANY[0])
    book = library.CalamineWorkbook.from_filelike(io.BytesIO(content))
    sheets = [rows for name in book.sheet_names if (rows := book.get_sheet_by_name(name).to_python())]
    header, *_ = max(sheets, key=len, default=[[]])
    yield header
    for first, *rows in sheets:
        if first == header:
            yield from ([_cell(cell) for cell in row] for row in rows)


def _cell(cell: Any) -> Any:
    """A cell as text states it: times by ISO 8601, whole numbers without a point."""
    if isinstance(cell, dt.datetime):
        return cell.isoformat(" ")
    if isinstance(cell, (dt.date, dt.time)):
        return cell.isoformat()
    return int(cell) if isinstance(cell, float) and cell.is_integer() else cell


def _dss(content: bytes) -> Rows:
    """HEC-DSS 6 and 7: every time series, by its path without the dates; times have no offset."""
    library = import_module("hecdss")
    library.HecDss.set_global_debug_level(0)  # it writes to the standard output
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "export.dss")
        path.write_bytes(content)
        with library.HecDss(str(path)) as file:
            for entry in file.get_catalog():
                if not entry.is_time_series():
                    continue
                series = file.get(str(entry))
                parts = str(entry).strip("/").split("/")
                tag = " ".join(part for k, part in enumerate(parts) if part and k != 3)
                for at, value in zip(series.times, series.values, strict=True):
                    there = np.isfinite(value) and value not in DSS_MISSING
                    yield at.isoformat(), tag, float(value) if there else "", series.units, ""


DSS_MISSING = (-901.0, -902.0, -float(np.finfo(np.float32).max))
"""Values that HEC-DSS stores for missing ones."""
ZIP, OLE = b"PK\x03\x04", b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1"  # first bytes of workbooks, new and old


def _is_workbook(content: bytes) -> bool:
    parts = (b"xl/workbook", b"opendocument.spreadsheet")
    return content.startswith(OLE) or (content.startswith(ZIP) and any(part in content for part in parts))


def _is_xml(roots: bytes) -> Callable[[bytes], bool]:
    of_root = re.compile(rb"(?:\xef\xbb\xbf)?\s*(?:<[?!][^>]*>\s*)*<(?:\w+:)?(?:" + roots + rb")[\s>]")
    return lambda content: of_root.match(content) is not None


def _is_features(content: bytes) -> bool:
    return content[:4].lstrip(b"\xef\xbb\xbf").startswith(b"{") and b'"FeatureCollection"' in content[:4096]


FORMATS: dict[str, tuple[Callable[[bytes], bool], Callable[[bytes], Rows]]] = {
    "netCDF": (lambda content: content.startswith((b"CDF\x01", b"CDF\x02", b"\x89HDF\r\n")), _netcdf),
    "a workbook": (_is_workbook, _workbook),
    "HEC-DSS": (lambda content: content.startswith(b"ZDSS"), _dss),
    "PI-XML": (_is_xml(rb"TimeSeries"), _pi_xml),
    "WaterML 2": (_is_xml(rb"Collection|OM_Observation|ObservationCollection"), _waterml),
    "JSON of the OGC API": (_is_features, _ogc_json),
}
"""How each format is recognised, and read."""
