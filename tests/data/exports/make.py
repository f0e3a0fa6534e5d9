"""Generate the corpus of foreign exports, files and measured values of each system, without rivid.

        python tests/data/exports/make.py      writes every case again, with the same bytes each time

A case is a folder: the exported files, `config.toml` that declares them (by hand), `expected.csv` with the
values that a reader must find: seconds since 1970, u_Qi, u_Qo [m3/s] and h_L [m], empty if not measured.
"""

import datetime as dt
import json
import math
from functools import reduce
from operator import add
from pathlib import Path
from zoneinfo import ZoneInfo

HERE = Path(__file__).parent
STEP = 900
CET, PARIS = dt.timezone(dt.timedelta(hours=1)), ZoneInfo("Europe/Paris")
CFS, FT = 0.028316846592, 0.3048
MARCH = dt.date(2008, 3, 13)
ISO, DASHES, SLASHES = "%Y-%m-%dT%H:%M:%S", "%Y-%m-%d %H:%M:%S", "%d/%m/%Y %H:%M"
CASES = {}
"""Every case by name: a function that returns the files by name and the expected values by UTC second."""


def case(function):
    CASES[function.__name__] = function
    return function


def world(first=MARCH, n_days=2, zone=CET):
    """Return the measured values: UTC seconds to inflow (whole m3/s), outflow (whole m3/s), level (mm)."""
    start, end = (dt.datetime.combine(first + dt.timedelta(days=k), dt.time(), zone) for k in (0, n_days))
    truth = {}
    for k, second in enumerate(range(int(start.timestamp()), int(end.timestamp()), STEP)):
        inflow = 320 + round(90 * math.sin(k / 15)) + 17 * (k // 9 % 5) + (k * k) % 3
        outflow = 318 + round(85 * math.sin((k - 3) / 15)) + 17 * ((k - 3) // 9 % 5)
        level = 118_000 + round(220 * math.cos(k / 15)) + (k * 7) % 11
        truth[second] = [inflow, outflow, level / 1000]
    return truth


def clock(second, zone, form):
    return dt.datetime.fromtimestamp(second, zone).strftime(form)


def rewritten(truth, factors, forms):
    """Return the values as text in other units, and their exact values in m3/s and m."""
    texts, meant = {}, {}
    for second, values in truth.items():
        texts[second] = [form.format(v / f) for v, f, form in zip(values, factors, forms, strict=True)]
        cells = (c.replace(",", "").strip('"') for c in texts[second])
        meant[second] = [float(c) * f for c, f in zip(cells, factors, strict=True)]
    return texts, meant


def plain(truth):
    return {s: [str(i), str(o), f"{h:.3f}"] for s, (i, o, h) in truth.items()}


def lines_of(texts, form, separator=",", zone=CET, other=()):
    """Return a line per moment; `other` has cells by (row, column) that are logged in place of the value."""
    return [
        separator.join([clock(s, zone, form), *(dict(other).get((k, j), c) for j, c in enumerate(cells))])
        for k, (s, cells) in enumerate(texts.items())
    ]


def without(expected, *cells):
    """Return the expected values without these (row, column), which were not measured."""
    moments = sorted(expected)
    for row, column in cells:
        expected[moments[row]][column] = None
    return expected


def joined(lines, newline="\n", encoding="utf-8"):
    return (newline.join(lines) + newline).encode(encoding)


@case
def campbell():
    """TOA5: four lines above the data, quoted stamps and NAN, a record number."""
    truth, lost = world(), ((40, 2), (41, 0))
    lines = [
        '"TOA5","Barrage","CR1000","31415","CR1000.Std.27","CPU:barrage.CR1","5271","Table1"',
        '"TIMESTAMP","RECORD","Inflow_Avg","Outflow_Avg","Level"',
        '"TS","RN","m3/s","m3/s","m"',
        '"","","Avg","Avg","Smp"',
    ]
    for k, line in enumerate(lines_of(plain(truth), f'"{DASHES}"', other=dict.fromkeys(lost, '"NAN"'))):
        time, cells = line.split(",", 1)
        lines.append(f"{time},{1000 + k},{cells}")
    return {"Barrage_Table1.dat": joined(lines, "\r\n")}, without(truth, *lost)


@case
def usgs():
    """RDB: comments, a row of column widths, flags after the values, MST before and MDT after the change."""
    zone = ZoneInfo("America/Denver")
    texts, meant = rewritten(
        world(dt.date(2024, 3, 9), 3, zone), (CFS, CFS, FT), ("{:.0f}", "{:.0f}", "{:.2f}")
    )
    names = ["agency_cd", "site_no", "datetime", "tz_cd"]
    for series in ("111_00060", "222_00060", "333_00065"):
        names += [series, f"{series}_cd"]
    lines = [
        "# ---------------------------------- WARNING ----------------------------------------",
        "# Some of the data that you have obtained may not have received Director's approval.",
        "#",
        "# Data provided for site 09999999",
        "#  111_00060  Discharge, cubic feet per second, above",
        "#  222_00060  Discharge, cubic feet per second, below",
        "#  333_00065  Gage height, feet",
        "#",
        "\t".join(names),
        "\t".join(["5s", "15s", "20d", "6s", *["14n", "10s"] * 3]),
    ]
    odd = {(30, 0): "Eqp\tP", (31, 1): "\t", (90, 2): "Ice\tA", (120, 0): "99999\te", (121, 2): "99999\te"}
    flagged = {second: [f"{cell}\tA" for cell in cells] for second, cells in texts.items()}
    rows = lines_of(flagged, "%Y-%m-%d %H:%M\t%Z", "\t", zone, odd)
    return {"09999999.rdb": joined(lines + [f"USGS\t09999999\t{row}" for row in rows])}, without(meant, *odd)


@case
def fews():
    """FEWS: three rows above the data, the parameter alone is not unique, -999 for a missing value."""
    truth, lost = world(), ((10, 2), (11, 2), (100, 0))
    lines = [
        "Location Names,Upper Dam,Lower Dam,Lower Dam",
        "Location Ids,H-2001,H-2002,H-2002",
        "Time,Q.inflow [m3/s],Q.outflow [m3/s],H.obs [m]",
        *lines_of(plain(truth), DASHES, other=dict.fromkeys(lost, "-999.0")),
    ]
    return {"export_fews.csv": joined(lines)}, without(truth, *lost)


@case
def zrxp():
    """ZRXP: blocks of one series each, described in comments; no header; status next to the value; -777."""
    truth, lines = world(), []
    status, lost = {(20, 0): "255", (150, 2): "255"}, {(21, 0), (160, 1)}
    for j, (tag, unit) in enumerate([("UPPER.Q", "m3/s"), ("LOWER.Q", "m3/s"), ("LOWER.W", "m")]):
        lines += [
            f"#SANR{2000 + j}|*|SNAMEDam|*|SWATERRiver|*|CNR{j}|*|",
            f"#REXCHANGE{tag}|*|RINVAL-777|*|CUNIT{unit}|*|TZUTC+1|*|",
            "#LAYOUT(timestamp,value,status)|*|",
        ]
        for k, (second, cells) in enumerate(plain(truth).items()):
            value = "-777" if (k, j) in lost else cells[j]
            lines.append(f"{clock(second, CET, '%Y%m%d%H%M%S')} {value} {status.get((k, j), '40')}")
    return {"series.zrx": joined(lines, "\r\n")}, without(truth, *status, *lost)


@case
def french():
    """A French spreadsheet: latin-1, semicolons, decimal commas, a title, a row of units, day first."""
    truth, other = world(), {(33, 1): "défaut"}
    texts = {s: [c.replace(".", ",") for c in cells] for s, cells in plain(truth).items()}
    lines = ["Télérelève;;;", "Export du 15/03/2008;;;", "Date;Débit amont;Débit turbiné;Cote retenue"]
    lines += [";m³/s;m³/s;m NGF", *lines_of(texts, SLASHES, ";", other=other)]
    return {"telereleve.csv": joined(lines, "\r\n", "latin-1")}, without(truth, *other)


@case
def german():
    """German: points between thousands, decimal commas, centimetres, date and clock in columns, hour 24."""
    texts, meant = rewritten(world(), (1e-3, 1e-3, 1e-2), ("{:,.1f}",) * 3)
    swap, lines = str.maketrans(",.", ".,"), ["Datum;Uhrzeit;Zufluss [l/s];Abfluss [l/s];Wasserstand [cm]"]
    for second, cells in texts.items():
        time = clock(second, CET, "%d.%m.%Y;%H:%M")
        if time.endswith("00:00"):
            time = clock(second - 1, CET, "%d.%m.%Y;24:00")
        lines.append(";".join([time, *(c.translate(swap) for c in cells)]))
    return {"pegel.csv": joined(lines)}, meant


@case
def american():
    """American: month first, AM and PM, quoted commas between thousands, cfs and feet."""
    texts, meant = rewritten(world(), (CFS, CFS, FT), ('"{:,.0f}"', '"{:,.0f}"', "{:.2f}"))
    lines = [
        "Timestamp,Inflow (cfs),Outflow (cfs),Forebay Elevation (ft)",
        *lines_of(texts, "%m/%d/%Y %I:%M %p"),
    ]
    return {"scada.csv": joined(lines, encoding="utf-8-sig")}, meant


@case
def undecidable():
    """One day, 4 March or 3 April: the file does not determine it, nor its unit and zone."""
    truth = world(dt.date(2008, 4, 3), 1)
    return {"day.csv": joined(["when;inflow;outflow;level", *lines_of(plain(truth), SLASHES, ";")])}, truth


@case
def utf16():
    """UTF-16 with tabs; two exports joined, each with its header, the second overlaps the first."""
    truth, head = world(), "Time\tInflow m3/s\tOutflow m3/s\tLevel m"
    rows = lines_of(plain(truth), DASHES, "\t")
    return {"trend.txt": joined([head, *rows[:100], "", head, *rows[96:]], "\r\n", "utf-16")}, truth


@case
def historian():
    """Long: a row per value, with its quality, states as text, other tags, late and duplicate rows."""
    truth, rows = world(), []
    odd = {(50, 0): "999,Bad", (51, 2): "0,Bad", (70, 1): "I/O Timeout,Good", (71, 1): "No Data,Good"}
    for k, (second, cells) in enumerate(plain(truth).items()):
        time = clock(second, dt.UTC, f"{ISO}.000Z")
        for j, tag in enumerate(("PLANT.UP.FLOW_IN", "PLANT.DN.FLOW_OUT", "PLANT.DN.LEVEL")):
            rows.append(f"{time},{tag},{odd.get((k, j), f'{cells[j]},Good')}")
        if k % 4 == 0:
            rows.append(f"{time},PLANT.DN.TEMP,{5 + k % 3},Good")
    rows.insert(300, rows.pop(200))
    rows.insert(310, rows[309])
    return {"historian.csv": joined(["Timestamp,Tag,Value,Quality", *rows])}, without(truth, *odd)


@case
def exception():
    """Long, by exception: a value is logged when it changes, and again after an hour; a state ends it."""
    truth, rows, last = world(), [], {}
    for k, second in enumerate(truth):
        truth[second][0] = 300 + 20 * (k // 7)  # steps
        for j, tag in enumerate(("IN", "OUT", "LEVEL")):
            value, since = truth[second][j], last.get(tag)
            if (k, j) == (60, 2):
                rows.append((second + 30, tag, "Comm Fail"))
                last.pop(tag)
            elif since is None or value != since[1] or second - since[0] >= 3600:
                # reported some seconds before the quarter hour at which it is valid
                rows.append((second - 20 * (k > 0), tag, f"{value:.3f}"))
                last[tag] = (second, value)
    moments = sorted(truth)
    # the state comes 30 s after the quarter: 60 still has the value before it, 61 has the next report
    truth[moments[60]][2] = truth[moments[59]][2]
    lines = ["time;tag;value", *(f"{clock(s, CET, ISO)};{t};{v}" for s, t, v in sorted(rows))]
    return {"changes.csv": joined(lines)}, truth


@case
def tag_files():
    """Long: a file per tag; only the file name gives the tag."""
    truth = world()
    columns = ({s: [cells[j]] for s, cells in plain(truth).items()} for j in range(3))
    return {
        f"{tag}.csv": joined(["Time;Value", *lines_of(column, DASHES, ";")])
        for tag, column in zip(("UP_Q", "DN_Q", "DN_H"), columns, strict=True)
    }, truth


@case
def split():
    """Wide: the flows in one file, the level in another, each with its own times."""
    truth, files = world(), {}
    for name, head, part in (
        ("flows", "time,inflow,outflow", slice(2)),
        ("levels", "time,level", slice(2, 3)),
    ):
        texts = {s: cells[part] for s, cells in plain(truth).items()}
        files[f"{name}.csv"] = joined([head, *lines_of(texts, f"{ISO}+01:00")])
    return files, truth


def local(name, first):
    """Return three days of local time in Paris."""
    truth = world(first, 3, PARIS)
    return {name: joined(["time;inflow;outflow;level", *lines_of(plain(truth), SLASHES, ";", PARIS)])}, truth


@case
def october():
    """Local time on the night with a repeated hour: 25 hours, in order."""
    return local("octobre.csv", dt.date(2008, 10, 25))


@case
def march():
    """Local time on the night with a missing hour: 23 hours."""
    return local("mars.csv", dt.date(2008, 3, 29))


@case
def units_of_plant():
    """The outflow is the sum of two units and the gates; each has a flag, and a bad one spoils the sum."""
    truth = world()
    head = "time,inflow,inflow flag,unit 1,unit 1 flag,unit 2,unit 2 flag,gates,gates flag,level,level flag"
    parts = {s: [i, o // 2, o - o // 2 - 8, 8, h] for s, (i, o, h) in truth.items()}
    texts = {s: [f"{v:g}," for v in values] for s, values in parts.items()}
    for row, column in ((25, 2), (26, 4)):
        texts[sorted(texts)[row]][column] += "B"
    return {"plant.csv": joined([head, *lines_of(texts, f"{ISO}+01:00")])}, without(truth, (25, 1), (26, 2))


@case
def hourly_means():
    """Hourly means of the inflow, stamped at their end, among rows of a quarter of an hour."""
    truth = world()
    moments = sorted(truth)
    means = [truth[moments[k // 4 * 4]][0] for k in range(len(moments))]
    texts = {s: ["", *cells[1:]] for s, cells in plain(truth).items()} | {moments[-1] + STEP: [""] * 3}
    for k, second in enumerate(moments):  # logged once an hour, it is valid from the beginning of the hour
        truth[second][0] = None if k % 4 else means[k]
    ends = {(k, 0): str(means[k - 1]) for k in range(4, len(moments) + 1, 4)}
    return {
        "means.csv": joined(["time,inflow,outflow,level", *lines_of(texts, f"{ISO}+01:00", other=ends)])
    }, truth


@case
def two_plants():
    """An extract of a historian: the upper plant in three parts, the lower dam; titles above, means below."""
    texts, _ = rewritten(world(), (CFS, CFS, FT), ("{:.1f}", "{:,.1f}", "{:.2f}"))
    names = ["UPR.G1.FLOW (cfs)", "UPR.G2.FLOW (cfs)", "UPR.GATES (cfs)", "LWR.TOTAL.RELEASE (cfs)"]
    lines = ['"Report: TWO PLANTS"', '"Generated 03/15/2008 7:02 AM"', '"Point","x"']
    lines.append(",".join(["Timestamp", *(f'"{name}"' for name in [*names, "LWR.POND.ELEV (ft)"])]))
    bad, meant = {(20, 1): "Bad Input", (21, 4): "I/O Timeout"}, {}
    for k, (second, (inflow, outflow, level)) in enumerate(texts.items()):
        parts = [f"{float(inflow) * share:,.1f}" for share in (0.4, 0.35, 0.25)]
        cells = [bad.get((k, j), cell) for j, cell in enumerate([*parts, outflow, level])]
        quoted = [f'"{cell}"' if "," in cell else cell for cell in cells]
        moment = dt.datetime.fromtimestamp(second, CET)
        date = f"{moment.month}/{moment.day}/{moment.year}"
        lines.append(",".join([f"{date} {moment.hour % 12 or 12}:{moment:%M:%S %p}", *quoted]))
        numbers = [float(part.replace(",", "")) for part in parts]
        flows = [reduce(add, numbers) * CFS, float(outflow.replace(",", "")) * CFS]
        meant[second] = [*flows, float(level) * FT]
    lines += ["Average,,,,,", '"*** End of report ***"']
    return {"extract.csv": joined(lines, "\r\n")}, without(meant, (20, 0), (21, 2))


@case
def pi_xml():
    """Delft-FEWS PI-XML: a series per parameter, flags of 0 to 9, a number for missing values."""
    truth, odd = world(), {(60, 0): ("371", "6"), (61, 2): ("-999.0", "9")}
    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        '<TimeSeries xmlns="http://www.wldelft.nl/fews/PI" version="1.2">',
        "<timeZone>1.0</timeZone>",
    ]
    names = [("H-2001", "Q.inflow", "m3/s"), ("H-2002", "Q.outflow", "m3/s"), ("H-2002", "H.obs", "m")]
    moments = [clock(s, CET, 'date="%Y-%m-%d" time="%H:%M:%S"') for s in truth]
    for j, (place, parameter, unit) in enumerate(names):
        lines += [
            f"<series><header><type>instantaneous</type><locationId>{place}</locationId>",
            f'<parameterId>{parameter}</parameterId><timeStep unit="second" multiplier="{STEP}"/>',
            f"<startDate {moments[0]}/><endDate {moments[-1]}/>",
            f"<missVal>-999.0</missVal><units>{unit}</units></header>",
        ]
        for k, cells in enumerate(plain(truth).values()):
            value, flag = odd.get((k, j), (cells[j], "0"))
            lines.append(f'<event {moments[k]} value="{value}" flag="{flag}"/>')
        lines.append("</series>")
    return {"export.xml": joined([*lines, "</TimeSeries>"])}, without(truth, *odd)


@case
def waterml():
    """WaterML 2: an observation per series, offsets in its times, a qualifier for estimated values."""
    truth, estimated, lost = world(), (44, 1), (45, 0)
    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        '<wml2:Collection xmlns:wml2="http://www.opengis.net/waterml/2.0" xmlns:om="http://www.opengis.net/om/2.0"',
        ' xmlns:xlink="http://www.w3.org/1999/xlink" xmlns:gml="http://www.opengis.net/gml/3.2">',
    ]
    names = [("upper", "Inflow", "m3/s"), ("lower", "Outflow", "m3/s"), ("lower", "Water level", "m")]
    for j, (place, what, unit) in enumerate(names):
        lines += [
            "<wml2:observationMember><om:OM_Observation>",
            f'<om:observedProperty xlink:href="urn:{j}" xlink:title="{what}"/>',
            f'<om:featureOfInterest xlink:href="urn:{place}" xlink:title="{place}"/>',
            "<om:result><wml2:MeasurementTimeseries><wml2:defaultPointMetadata>",
            f'<wml2:DefaultTVPMeasurementMetadata><wml2:uom code="{unit}"/>',
            '<wml2:qualifier xlink:title="Good"/></wml2:DefaultTVPMeasurementMetadata>',
            "</wml2:defaultPointMetadata>",
        ]
        for k, (second, cells) in enumerate(plain(truth).items()):
            value = '<wml2:value xsi:nil="true" xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance"/>'
            if (k, j) != lost:
                value = f"<wml2:value>{cells[j]}</wml2:value>"
            if (k, j) == estimated:
                value += (
                    '<wml2:metadata><wml2:TVPMeasurementMetadata><wml2:qualifier xlink:title="Estimated"/>'
                )
                value += "</wml2:TVPMeasurementMetadata></wml2:metadata>"
            time = f"<wml2:time>{clock(second, CET, ISO)}+01:00</wml2:time>"
            lines.append(f"<wml2:point><wml2:MeasurementTVP>{time}{value}</wml2:MeasurementTVP></wml2:point>")
        lines += [
            "</wml2:MeasurementTimeseries></om:result>",
            "</om:OM_Observation></wml2:observationMember>",
        ]
    return {"series.wml": joined([*lines, "</wml2:Collection>"])}, without(truth, estimated, lost)


@case
def ogc_json():
    """OGC API of the USGS: a feature per value, in any order, approved or provisional, with qualifiers."""
    texts, meant = rewritten(world(), (CFS, CFS, FT), ("{:.0f}", "{:.0f}", "{:.2f}"))
    odd = {(12, 2): ("0.0", ["ICE"]), (13, 0): (None, None)}
    names = [("USGS-111", "00060", "ft^3/s"), ("USGS-222", "00060", "ft^3/s"), ("USGS-222", "00065", "ft")]
    features = []
    for k, (second, cells) in enumerate(texts.items()):
        for j, (place, parameter, unit) in enumerate(names):
            value, qualifier = odd.get((k, j), (cells[j], None))
            properties = {
                "time_series_id": f"{j:032x}", "monitoring_location_id": place, "parameter_code": parameter,
                "statistic_id": "00011", "time": clock(second, dt.UTC, f"{ISO}+00:00"), "value": value,
                "unit_of_measure": unit, "approval_status": "Approved", "qualifier": qualifier,
            }  # fmt: skip
            features.append({"type": "Feature", "id": f"{j}-{k}", "geometry": None, "properties": properties})
    text = json.dumps({"type": "FeatureCollection", "features": features[::-1]}, indent=0)
    return {"continuous.json": joined([text])}, without(meant, *odd)


def contents(name):
    """Return the generated files of a case's folder."""
    files, expected = CASES[name]()
    rows = [
        ",".join([str(second), *("" if v is None else repr(v) for v in expected[second])])
        for second in sorted(expected)
    ]
    return {**files, "expected.csv": joined(["second,u_Qi,u_Qo,h_L", *rows])}


if __name__ == "__main__":
    for name in CASES:
        for file, data in contents(name).items():
            (HERE / name / file).write_bytes(data)
