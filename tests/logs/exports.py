"""A day as exported by foreign systems: one dialect each, with the declarations needed to read it."""

import datetime as dt
from dataclasses import dataclass, field

import numpy as np

from tests.daily import a_day
from tests.logs.helpers import DAY

N = 288
STEP = 300


@dataclass(frozen=True)
class Export:
    """A dialect."""

    head: tuple[str, ...] = ("time", "u_Qi", "u_Qo", "h_L")
    separator: str = ","
    decimal: str = "."
    thousands: str = ""
    encoding: str = "utf-8"
    time_format: str = "%Y-%m-%dT%H:%M:%S"
    hour_24: bool = False
    before: tuple[str, ...] = ()
    unit_row: tuple[str, ...] = ()
    newline: str = "\n"
    factors: tuple[float, float, float] = (1.0, 1.0, 1.0)
    holes: dict[tuple[int, int], str] = field(default_factory=dict)
    quote: bool = False
    extra: tuple[str, ...] = ()
    date: dt.date = DAY
    declared: dict[str, object] = field(default_factory=dict)

    def truth(self):
        """Return inflow, outflow and level on the grid of 300 s."""
        _, inflow, outflow, level = a_day(self.date)
        return np.array([inflow[:N], outflow[:N], level[:N]])

    def number(self, value):
        text = f"{value:,.3f}" if self.thousands else f"{value:.3f}"
        swap = {",": self.thousands, ".": self.decimal}
        text = "".join(swap.get(c, c) for c in text)
        return f'"{text}"' if self.quote else text

    def time(self, k):
        midnight = dt.datetime.combine(self.date, dt.time())
        moment = midnight + dt.timedelta(seconds=STEP * k)
        if self.hour_24 and k == 0:
            moment -= dt.timedelta(days=1)
            return moment.strftime(self.time_format.replace("%H", "24"))
        return moment.strftime(self.time_format)

    def to_bytes(self):
        values = self.truth() / np.array(self.factors)[:, None]
        lines = [*self.before, self.separator.join(self.head)]
        if self.unit_row:
            lines.append(self.separator.join(self.unit_row))
        for k in range(N):
            cells = [self.holes.get((k, j), self.number(values[j, k])) for j in range(3)]
            lines.append(self.separator.join([*self.time(k).split("|"), *cells, *self.extra]))
        return (self.newline.join(lines) + self.newline).encode(self.encoding)


CFS, FT = 0.028316846592, 0.3048

EXPORTS = {
    "plain": Export(),
    "french": Export(
        head=("Date", "Débit amont (m3/s)", "Débit turbiné (m3/s)", "Cote (m)"),
        separator=";", decimal=",", encoding="latin-1", time_format="%d/%m/%Y %H:%M", newline="\r\n",
        date=dt.date(2008, 3, 25),
        declared={"time": "Date", "u_Qi": "Débit amont (m3/s)",
                  "u_Qo": "Débit turbiné (m3/s)", "h_L": "Cote (m)",
                  "separator": ";", "decimal": ",", "encoding": "latin-1", "time_format": "%d/%m/%Y %H:%M"},
    ),
    "bom": Export(encoding="utf-8-sig", newline="\r\n"),
    "utf-16": Export(
        encoding="utf-16", separator="\t", declared={"encoding": "utf-16", "separator": "\t"},
    ),
    "american": Export(
        head=("Timestamp", "Inflow_cfs", "Outflow_cfs", "Forebay Elevation (ft)"),
        time_format="%m/%d/%Y %I:%M %p", factors=(CFS, CFS, FT), date=dt.date(2008, 3, 25),
        declared={"time": "Timestamp", "u_Qi": "Inflow_cfs",
                  "u_Qo": "Outflow_cfs", "h_L": "Forebay Elevation (ft)",
                  "time_format": "%m/%d/%Y %I:%M %p", "units": {"u_Qi": "cfs", "u_Qo": "cfs", "h_L": "ft"}},
    ),
    "thousands": Export(
        separator=";", thousands=",", factors=(1e-3, 1e-3, 1e-3),
        head=("time", "inflow l/s", "outflow l/s", "level mm"),
        declared={"separator": ";", "thousands": ",", "u_Qi": "inflow l/s", "u_Qo": "outflow l/s",
                  "h_L": "level mm", "units": {"u_Qi": "L/s", "u_Qo": "L/s", "h_L": "mm"}},
    ),
    "german": Export(
        head=("Zeit", "Zufluss", "Abfluss", "Wasserstand"), unit_row=("", "m³/s", "m³/s", "cm"),
        separator=";", decimal=",", thousands=".", time_format="%d.%m.%Y %H:%M:%S", factors=(1, 1, 0.01),
        declared={"time": "Zeit", "u_Qi": "Zufluss", "u_Qo": "Abfluss", "h_L": "Wasserstand", "unit_rows": 1,
                  "separator": ";", "decimal": ",", "thousands": ".", "time_format": "%d.%m.%Y %H:%M:%S",
                  "units": {"h_L": "cm"}},
    ),
    "preamble": Export(
        before=("Station;Basse Isere", "Export of 2008-04-01", ""), separator=";",
        declared={"skip_rows": 3, "separator": ";"},
    ),
    "hour 24": Export(
        separator=";", time_format="%d/%m/%Y %H:%M", hour_24=True,
        declared={"separator": ";", "time_format": "%d/%m/%Y %H:%M"}, date=dt.date(2008, 3, 25),
    ),
    "date and clock": Export(
        head=("Date", "Clock", "u_Qi", "u_Qo", "h_L"),
        time_format="%d/%m/%Y|%H:%M", date=dt.date(2008, 3, 25),
        declared={"time": ["Date", "Clock"], "time_format": "%d/%m/%Y %H:%M"},
    ),
    "clock with a point": Export(  # read as numbers, 22.10 and 22.1 would be the same clock time
        head=("Datum", "Uhrzeit", "u_Qi", "u_Qo", "h_L"), separator=";", decimal=",",
        time_format="%d.%m.%Y|%H.%M", date=dt.date(2008, 3, 25),
        declared={"time": ["Datum", "Uhrzeit"], "separator": ";", "decimal": ",",
                  "time_format": "%d.%m.%Y %H.%M"},
    ),
    "sentinels and status": Export(
        holes={(7, 2): "-999.000", (80, 2): "-999.000", (9, 0): "Eqp", (60, 1): "#N/A", (70, 1): ""},
        declared={"sentinels": [-999.0], "missing": ["", "#N/A", "Eqp"]},
    ),
    "quoted commas": Export(decimal=",", quote=True, declared={"decimal": ","}),
    "quality flags": Export(
        head=("time", "u_Qi", "u_Qo", "h_L", "quality", "comment"), extra=("A", '"fine, all"'),
    ),
    "unix": Export(
        head=("timestamp", "u_Qi", "u_Qo", "h_L"), time_format="%s",
        declared={"time": "timestamp", "time_format": "unix"},
    ),
}  # fmt: skip
"""Every dialect by name."""
