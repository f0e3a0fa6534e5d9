"""The files of a diagnosis: the answer, the unexplained inflow, pictures and a page."""

import datetime as dt
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from rivid.atomic import write_text
from rivid.diagnosis.answer import Evidence
from rivid.diagnosis.result import Diagnosis
from rivid.effects import Effect

BAND = 1.959964
"""Standard deviations to either side of a 95 % band."""

FLOWS = ("w_m3s", "low", "high", "w_before_m3s", "low_before", "high_before")
"""Columns of unexplained_inflow.parquet after `time`."""

MEANINGS: dict[str, tuple[str, str]] = {
    "time": ("", "local wall time, as the days of the logs are"),
    "w_m3s": ("m3/s", "inflow that no log explains, with the named effects in"),
    "low": ("m3/s", "lower end of its 95 % band"),
    "high": ("m3/s", "upper end of it"),
    "w_before_m3s": ("m3/s", "the same without the named effects"),
    "low_before": ("m3/s", "lower end of its 95 % band"),
    "high_before": ("m3/s", "upper end of it"),
}
"""Unit and meaning of each column of unexplained_inflow.parquet."""


def write_diagnosis(
    out: Path,
    diagnosis: Diagnosis,
    evidence: Evidence | None,
    *,
    draw: bool = True,
    reach: str = "",
    classes: Mapping[str, type[Effect]] | None = None,
) -> Path:
    """Write diagnosis.json, unexplained_inflow.parquet, figures/diagnosis_*.png and diagnosis.html.

    Parameters
    ----------
    out : Path
        OUT; made where it is missing. Other files in it stay as they are.
    diagnosis : Diagnosis
    evidence : Evidence or None
        None where the data were too few for any.
    draw : bool
        Whether to draw; without, pictures of an earlier diagnosis go.
    reach : str
        Its name, for the page.
    classes : mapping of str to type of Effect, optional
        What the effects are, by name; default: :func:`rivid.effects.effect_classes`. A name that is not
        among them is shown without words.

    Returns
    -------
    Path
        The page.

    Raises
    ------
    RividError
        Where a file cannot be written.

    Notes
    -----
    The same answer gives the same bytes. Each file is there whole or not at all; diagnosis.json is written
    last.
    """
    from rivid.report.diagnosis_page import write_page
    from rivid.report.diagnosis_pictures import draw_pictures, drop_pictures

    write_inflow(out / "unexplained_inflow.parquet", evidence)
    files = draw_pictures(out, diagnosis, evidence) if draw else []
    drop_pictures(out, files)
    page = write_page(out, diagnosis, evidence, files, reach=reach, classes=classes)
    write_text(out / "diagnosis.json", diagnosis.to_json())
    return page


def write_inflow(path: Path, evidence: Evidence | None) -> None:
    """Write the unexplained inflow with its 95 % band: a row for each sample that counts.

    Parameters
    ----------
    path : Path
    evidence : Evidence or None
        None gives a table without rows.

    Notes
    -----
    `time` is local wall time, as the days of the logs are. `w_m3s`, `low` and `high` are with the named
    effects; `w_before_m3s` and its band without them [m3/s].
    """
    import pyarrow as pa

    from rivid.results.tables import to_table, write_parquet

    schema = pa.schema([("time", pa.timestamp("ms")), *((name, pa.float64()) for name in FLOWS)])
    columns: dict[str, Any] = {name: [] for name in schema.names}
    if evidence is not None:
        record = evidence.record
        kept = record.used
        midnight = np.datetime64(dt.datetime.combine(record.dates[0], dt.time()), "ms")
        time = midnight + np.round(1000.0 * record.time[kept]).astype("timedelta64[ms]")
        columns = {"time": pa.array(time)}
        series = (
            (evidence.inflow_after, evidence.inflow_after_sd),
            (evidence.inflow_before, evidence.inflow_before_sd),
        )
        bands = [(w[kept], w[kept] - BAND * sd[kept], w[kept] + BAND * sd[kept]) for w, sd in series]
        columns |= dict(zip(FLOWS, (part for band in bands for part in band), strict=True))
    write_parquet(to_table(columns, schema), path)
