"""The corpus of foreign exports: what each system writes, and what was measured. Knows nothing of rivid.

    python tests/data/exports/make.py      writes every case again, the same bytes each time

A case is a folder: the exported files, `config.toml` that declares them, and `expected.csv` with what a
reader must find: seconds since 1970, u_Qi, u_Qo [m3/s] and h_L [m], empty where nothing was measured.
"""

import datetime as dt
import math
import shutil
from dataclasses import dataclass, field
from functools import reduce
from operator import add
from pathlib import Path
from zoneinfo import ZoneInfo

HERE = Path(__file__).parent
STEP = 900
CET = dt.timezone(dt.timedelta(hours=1))
CFS, FT = 0.028316846592, 0.3048
TAGS = ("u_Qi", "u_Qo", "h_L")


@dataclass
class Case:
    """Files by name, the declaration, and the expected values by moment (UTC seconds)."""

    files: dict[str, bytes]
    config: str
    expected: dict[int, list[float | None]] = field(default_factory=dict)


def world(first, n_days, zone=CET):
    """What happened: UTC seconds to inflow (whole m3/s), outflow (whole m3/s), level (mm)."""
    start = dt.datetime.combine(first, dt.time(), zone)
    end = dt.datetime.combine(first + dt.timedelta(days=n_days), dt.time(), zone)
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
    """The values as another unit's text holds them, and what that text means in m3/s and m."""
    texts, meant = {}, {}
    for second, values in truth.items():
        cells = [form.format(v / f) for v, f, form in zip(values, factors, forms, strict=True)]
        texts[second] = cells
        meant[second] = [float(c.replace(",", "")) * f for c, f in zip(cells, factors, strict=True)]
    return texts, meant


def plain(truth):
    return {s: [str(i), str(o), f"{h:.3f}"] for s, (i, o, h) in truth.items()}


def holes(expected, cells):
    """Nothing was measured in these (row, column)."""
    moments = sorted(expected)
    for row, column in cells:
        expected[moments[row]][column] = None


def joined(lines, newline="\n"):
    return newline.join(lines) + newline


REACH = "[reach]\nsample_time = 900\n\n[input]\n"
MARCH = dt.date(2008, 3, 13)


def campbell():
    """TOA5: four lines above the data, quoted stamps and NAN, a record number."""
    truth = world(MARCH, 2)
    texts = plain(truth)
    lines = [
        '"TOA5","Barrage","CR1000","31415","CR1000.Std.27","CPU:barrage.CR1","5271","Table1"',
        '"TIMESTAMP","RECORD","Inflow_Avg","Outflow_Avg","Level"',
        '"TS","RN","m3/s","m3/s","m"',
        '"","","Avg","Avg","Smp"',
    ]
    for k, (second, cells) in enumerate(texts.items()):
        cells = ["NAN" if (k, j) in ((40, 2), (41, 0)) else c for j, c in enumerate(cells)]
        quoted = ['"NAN"' if c == "NAN" else c for c in cells]
        lines.append(",".join([f'"{clock(second, CET, "%Y-%m-%d %H:%M:%S")}"', str(1000 + k), *quoted]))
    holes(truth, [(40, 2), (41, 0)])
    config = REACH + (
        'time = "TIMESTAMP"\nu_Qi = "Inflow_Avg"\nu_Qo = "Outflow_Avg"\nh_L = "Level"\n'
        'time_zone = "Etc/GMT-1"\nskip_rows = 1\nunit_rows = 2\nmissing = ["", "NAN"]\nmax_gap = 1800\n'
    )
    return Case({"Barrage_Table1.dat": joined(lines, "\r\n").encode()}, config, truth)


def usgs():
    """RDB: comments, a row of column widths, flags beside the values, MST before and MDT after the change."""
    zone = ZoneInfo("America/Denver")
    truth = world(dt.date(2024, 3, 9), 3, zone)
    texts, meant = rewritten(truth, (CFS, CFS, FT), ("{:.0f}", "{:.0f}", "{:.2f}"))
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
    status = {(30, 0): ("Eqp", "P"), (31, 1): ("", ""), (90, 2): ("Ice", "A")}
    flagged = {(120, 0), (121, 2)}
    for k, (second, cells) in enumerate(texts.items()):
        row = ["USGS", "09999999", clock(second, zone, "%Y-%m-%d %H:%M"), clock(second, zone, "%Z")]
        for j, cell in enumerate(cells):
            row += status.get(
                (k, j), ("99999" if (k, j) in flagged else cell, "e" if (k, j) in flagged else "A")
            )
        lines.append("\t".join(row))
    holes(meant, [*status, *flagged])
    config = REACH + (
        'time = "datetime"\nu_Qi = "111_00060"\nu_Qo = "222_00060"\nh_L = "333_00065"\n'
        'time_zone = "America/Denver"\nzone_column = "tz_cd"\n'
        'separator = "\\t"\ncomment = "#"\nunit_rows = 1\ngood = ["A", "P"]\nmissing = ["", "Eqp", "Ice"]\n'
        'max_gap = 1800\nignore = ["agency_cd", "site_no"]\n\n'
        '[input.zones]\nMST = "-07:00"\nMDT = "-06:00"\n\n'
        '[input.units]\nu_Qi = "cfs"\nu_Qo = "cfs"\nh_L = "ft"\n\n'
        '[input.quality]\nu_Qi = "111_00060_cd"\nu_Qo = "222_00060_cd"\nh_L = "333_00065_cd"\n'
    )
    return Case({"09999999.rdb": joined(lines).encode()}, config, meant)


def fews():
    """FEWS: three rows above the data, the parameter alone is not distinct, -999 where nothing is."""
    truth = world(MARCH, 2)
    lines = [
        "Location Names,Upper Dam,Lower Dam,Lower Dam",
        "Location Ids,H-2001,H-2002,H-2002",
        "Time,Q.inflow [m3/s],Q.outflow [m3/s],H.obs [m]",
    ]
    out = {(10, 2), (11, 2), (100, 0)}
    for k, (second, cells) in enumerate(plain(truth).items()):
        cells = ["-999.0" if (k, j) in out else c for j, c in enumerate(cells)]
        lines.append(",".join([clock(second, CET, "%Y-%m-%d %H:%M:%S"), *cells]))
    holes(truth, out)
    config = REACH + (
        'time = "Location Ids Time"\nu_Qi = "H-2001 Q.inflow [m3/s]"\nu_Qo = "H-2002 Q.outflow [m3/s]"\n'
        'h_L = "H-2002 H.obs [m]"\ntime_zone = "Etc/GMT-1"\nskip_rows = 1\nheader_rows = 2\n'
        "sentinels = [-999]\nmax_gap = 3600\n"
    )
    return Case({"export_fews.csv": joined(lines).encode()}, config, truth)


def zrxp():
    """ZRXP: blocks of one series each, said in comments; no header; status beside the value; -777."""
    truth = world(MARCH, 2)
    lines = []
    status = {(20, 0): "255", (150, 2): "255"}
    out = {(21, 0), (160, 1)}
    for j, (tag, unit) in enumerate([("UPPER.Q", "m3/s"), ("LOWER.Q", "m3/s"), ("LOWER.W", "m")]):
        lines += [
            f"#SANR{2000 + j}|*|SNAMEDam|*|SWATERRiver|*|CNR{j}|*|",
            f"#REXCHANGE{tag}|*|RINVAL-777|*|CUNIT{unit}|*|TZUTC+1|*|",
            "#LAYOUT(timestamp,value,status)|*|",
        ]
        for k, (second, cells) in enumerate(plain(truth).items()):
            value = "-777" if (k, j) in out else cells[j]
            lines.append(f"{clock(second, CET, '%Y%m%d%H%M%S')} {value} {status.get((k, j), '40')}")
    holes(truth, [*status, *out])
    config = REACH + (
        'layout = "long"\ncolumns = ["timestamp", "value", "status"]\ntag_pattern = "#REXCHANGE([^|]+)"\n'
        'time = "timestamp"\nvalue = "value"\nquality = "status"\ngood = ["40"]\nu_Qi = "UPPER.Q"\n'
        'u_Qo = "LOWER.Q"\nh_L = "LOWER.W"\nseparator = " "\ncomment = "#"\ntime_format = "%Y%m%d%H%M%S"\n'
        'time_zone = "Etc/GMT-1"\nsentinels = [-777]\nmax_gap = 1800\n'
    )
    return Case({"series.zrx": joined(lines, "\r\n").encode()}, config, truth)


def french():
    """A spreadsheet in France: latin-1, semicolons, decimal commas, a title, a row of units, day first."""
    truth = world(MARCH, 2)
    lines = ["Télérelève;;;", "Export du 15/03/2008;;;", "Date;Débit amont;Débit turbiné;Cote retenue"]
    lines.append(";m³/s;m³/s;m NGF")
    text = {(33, 1): "défaut"}
    for k, (second, cells) in enumerate(plain(truth).items()):
        cells = [text.get((k, j), c.replace(".", ",")) for j, c in enumerate(cells)]
        lines.append(";".join([clock(second, CET, "%d/%m/%Y %H:%M"), *cells]))
    holes(truth, text)
    config = REACH + (
        'time = "Date"\nu_Qi = "Débit amont"\nu_Qo = "Débit turbiné"\nh_L = "Cote retenue"\n'
        'time_format = "%d/%m/%Y %H:%M"\ntime_zone = "Etc/GMT-1"\nencoding = "latin-1"\nseparator = ";"\n'
        'decimal = ","\nskip_rows = 2\nunit_rows = 1\nmissing = ["", "défaut"]\nmax_gap = 1800\n'
    )
    return Case({"telereleve.csv": joined(lines, "\r\n").encode("latin-1")}, config, truth)


def german():
    """Points between thousands, decimal commas, centimetres, date and clock in two columns, hour 24."""
    truth = world(MARCH, 2)
    lines = ["Datum;Uhrzeit;Zufluss [l/s];Abfluss [l/s];Wasserstand [cm]"]
    for second, (inflow, outflow, level) in truth.items():
        moment = dt.datetime.fromtimestamp(second, CET)
        day, hour = moment.strftime("%d.%m.%Y"), moment.strftime("%H:%M")
        if hour == "00:00":
            day, hour = (moment - dt.timedelta(days=1)).strftime("%d.%m.%Y"), "24:00"
        cells = [f"{v:,.1f}".replace(",", "_").replace(".", ",").replace("_", ".")
                 for v in (inflow * 1000, outflow * 1000, level * 100)]  # fmt: skip
        lines.append(";".join([day, hour, *cells]))
    factors = (1e-3, 1e-3, 1e-2)
    meant = {
        s: [float(f"{v / f:.1f}") * f for v, f in zip(values, factors, strict=True)]
        for s, values in truth.items()
    }
    config = REACH + (
        'time = ["Datum", "Uhrzeit"]\nu_Qi = "Zufluss [l/s]"\nu_Qo = "Abfluss [l/s]"\n'
        'h_L = "Wasserstand [cm]"\ntime_format = "%d.%m.%Y %H:%M"\ntime_zone = "Etc/GMT-1"\nseparator = ";"\n'
        'decimal = ","\nthousands = "."\n\n[input.units]\nu_Qi = "L/s"\nu_Qo = "L/s"\nh_L = "cm"\n'
    )
    return Case({"pegel.csv": joined(lines).encode()}, config, meant)


def american():
    """Month first, AM and PM, quoted commas between thousands, cfs and feet."""
    truth = world(MARCH, 2)
    texts, meant = rewritten(truth, (CFS, CFS, FT), ("{:,.0f}", "{:,.0f}", "{:.2f}"))
    lines = ["Timestamp,Inflow (cfs),Outflow (cfs),Forebay Elevation (ft)"]
    for second, (inflow, outflow, level) in texts.items():
        lines.append(f'{clock(second, CET, "%m/%d/%Y %I:%M %p")},"{inflow}","{outflow}",{level}')
    config = REACH + (
        'time = "Timestamp"\nu_Qi = "Inflow (cfs)"\nu_Qo = "Outflow (cfs)"\nh_L = "Forebay Elevation (ft)"\n'
        'time_format = "%m/%d/%Y %I:%M %p"\ntime_zone = "Etc/GMT-1"\nthousands = ","\n\n'
        '[input.units]\nu_Qi = "cfs"\nu_Qo = "cfs"\nh_L = "ft"\n'
    )
    return Case({"scada.csv": joined(lines).encode("utf-8-sig")}, config, meant)


def undecidable():
    """One day, 4 March or 3 April: nothing in the file tells, nor in which unit and zone it is."""
    truth = world(dt.date(2008, 4, 3), 1)
    lines = ["when;inflow;outflow;level"]
    for second, cells in plain(truth).items():
        lines.append(";".join([clock(second, CET, "%d/%m/%Y %H:%M"), *cells]))
    config = REACH + (
        'time = "when"\nu_Qi = "inflow"\nu_Qo = "outflow"\nh_L = "level"\nseparator = ";"\n'
        'time_format = "%d/%m/%Y %H:%M"\ntime_zone = "Etc/GMT-1"\n'
    )
    return Case({"day.csv": joined(lines).encode()}, config, truth)


def utf16():
    """UTF-16 with tabs; two exports pasted together, each with its header, the second overlaps the first."""
    truth = world(MARCH, 2)
    rows = ["\t".join([clock(s, CET, "%Y-%m-%d %H:%M:%S"), *cells]) for s, cells in plain(truth).items()]
    head = "Time\tInflow m3/s\tOutflow m3/s\tLevel m"
    lines = [head, *rows[:100], "", head, *rows[96:]]
    config = REACH + (
        'time = "Time"\nu_Qi = "Inflow m3/s"\nu_Qo = "Outflow m3/s"\nh_L = "Level m"\n'
        'time_zone = "Etc/GMT-1"\nencoding = "utf-16"\nseparator = "\\t"\nrepeated_header = "drop"\n'
    )
    return Case({"trend.txt": joined(lines, "\r\n").encode("utf-16")}, config, truth)


def historian():
    """Long: a row per value, quality beside it, states as text, other tags, late and doubled rows."""
    truth = world(MARCH, 2)
    tags = ("PLANT.UP.FLOW_IN", "PLANT.DN.FLOW_OUT", "PLANT.DN.LEVEL")
    rows = []
    bad = {(50, 0): ("999", "Bad"), (51, 2): ("0", "Bad")}
    states = {(70, 1): ("I/O Timeout", "Good"), (71, 1): ("No Data", "Good")}
    for k, (second, cells) in enumerate(plain(truth).items()):
        for j, tag in enumerate(tags):
            value, quality = (bad | states).get((k, j), (cells[j], "Good"))
            rows.append(f"{clock(second, dt.UTC, '%Y-%m-%dT%H:%M:%S.000Z')},{tag},{value},{quality}")
        if k % 4 == 0:
            rows.append(f"{clock(second, dt.UTC, '%Y-%m-%dT%H:%M:%S.000Z')},PLANT.DN.TEMP,{5 + k % 3},Good")
    late = rows.pop(200)
    rows.insert(300, late)
    rows.insert(310, rows[309])
    holes(truth, [*bad, *states])
    config = REACH + (
        'layout = "long"\ntime = "Timestamp"\ntag = "Tag"\nvalue = "Value"\n'
        'quality = "Quality"\ngood = ["Good"]\n'
        'u_Qi = "PLANT.UP.FLOW_IN"\nu_Qo = "PLANT.DN.FLOW_OUT"\nh_L = "PLANT.DN.LEVEL"\n'
        'missing = ["", "I/O Timeout", "No Data"]\ntime_zone = "Etc/GMT-1"\nmax_gap = 1800\n'
    )
    return Case({"historian.csv": joined(["Timestamp,Tag,Value,Quality", *rows]).encode()}, config, truth)


def exception():
    """Long, by exception: a value is logged when it changes, and again after an hour; a state ends it."""
    truth = world(MARCH, 2)
    tags = ("IN", "OUT", "LEVEL")
    rows, last = [], {}
    state = {(60, 2): "Comm Fail"}
    for k, second in enumerate(truth):
        truth[second][0] = 300 + 20 * (k // 7)  # steps
        for j, tag in enumerate(tags):
            value = truth[second][j]
            since = last.get(tag)
            if (k, j) in state:
                rows.append((second + 30, tag, state[k, j]))
                last.pop(tag)
            elif since is None or value != since[1] or second - since[0] >= 3600:
                # reported some seconds before the quarter at which it is seen
                rows.append((second - 20 * (k > 0), tag, f"{value:.3f}"))
                last[tag] = (second, value)
    moments = sorted(truth)
    # the state comes 30 s after the quarter: 60 still sees the value before it, 61 sees the next report
    truth[moments[60]][2] = truth[moments[59]][2]
    lines = ["time;tag;value", *(f"{clock(s, CET, '%Y-%m-%dT%H:%M:%S')};{t};{v}" for s, t, v in sorted(rows))]
    config = REACH + (
        'layout = "long"\ntag = "tag"\nu_Qi = "IN"\nu_Qo = "OUT"\nh_L = "LEVEL"\nseparator = ";"\n'
        'missing = ["", "Comm Fail"]\ntime_zone = "Etc/GMT-1"\n\n'
        "[input.hold]\nu_Qi = 3600\nu_Qo = 3600\nh_L = 3600\n"
    )
    return Case({"changes.csv": joined(lines).encode()}, config, truth)


def tag_files():
    """Long: a file per tag, told by the file's name alone."""
    truth = world(MARCH, 2)
    files = {}
    for j, tag in enumerate(("UP_Q", "DN_Q", "DN_H")):
        rows = [f"{clock(s, CET, '%Y-%m-%d %H:%M:%S')};{c[j]}" for s, c in plain(truth).items()]
        files[f"{tag}.csv"] = joined(["Time;Value", *rows]).encode()
    config = REACH + (
        'layout = "long"\ntime = "Time"\nvalue = "Value"\nu_Qi = "UP_Q"\nu_Qo = "DN_Q"\nh_L = "DN_H"\n'
        'separator = ";"\ntime_zone = "Etc/GMT-1"\n'
    )
    return Case(files, config, truth)


def split():
    """Wide: the flows in one file, the level in another, each with the times of its own."""
    truth = world(MARCH, 2)
    flows, levels = ["time,inflow,outflow"], ["time,level"]
    for second, (inflow, outflow, level) in plain(truth).items():
        flows.append(f"{clock(second, CET, '%Y-%m-%dT%H:%M:%S')}+01:00,{inflow},{outflow}")
        levels.append(f"{clock(second, CET, '%Y-%m-%dT%H:%M:%S')}+01:00,{level}")
    config = REACH + 'u_Qi = "inflow"\nu_Qo = "outflow"\nh_L = "level"\n'
    return Case({"flows.csv": joined(flows).encode(), "levels.csv": joined(levels).encode()}, config, truth)


def october():
    """Local time on the night when an hour comes twice: 25 hours, in order."""
    zone = ZoneInfo("Europe/Paris")
    truth = world(dt.date(2008, 10, 25), 3, zone)
    lines = ["time;inflow;outflow;level"]
    for second, cells in plain(truth).items():
        lines.append(";".join([clock(second, zone, "%d/%m/%Y %H:%M"), *cells]))
    config = REACH + (
        'u_Qi = "inflow"\nu_Qo = "outflow"\nh_L = "level"\nseparator = ";"\ntime_format = "%d/%m/%Y %H:%M"\n'
        'time_zone = "Europe/Paris"\nambiguous = "order"\n'
    )
    return Case({"octobre.csv": joined(lines).encode()}, config, truth)


def march():
    """Local time on the night when an hour is left out: 23 hours."""
    zone = ZoneInfo("Europe/Paris")
    truth = world(dt.date(2008, 3, 29), 3, zone)
    lines = ["time;inflow;outflow;level"]
    for second, cells in plain(truth).items():
        lines.append(";".join([clock(second, zone, "%d/%m/%Y %H:%M"), *cells]))
    config = REACH + (
        'u_Qi = "inflow"\nu_Qo = "outflow"\nh_L = "level"\nseparator = ";"\ntime_format = "%d/%m/%Y %H:%M"\n'
        'time_zone = "Europe/Paris"\n'
    )
    return Case({"mars.csv": joined(lines).encode()}, config, truth)


def units_of_plant():
    """The outflow is the sum of two units and the gates; each has its own flag, and one spoils the sum."""
    truth = world(MARCH, 2)
    lines = [
        "time,inflow,inflow flag,unit 1,unit 1 flag,unit 2,unit 2 flag,gates,gates flag,level,level flag"
    ]
    bad = {(25, "unit 2"), (26, "level")}
    for k, (second, (inflow, outflow, level)) in enumerate(truth.items()):
        first = outflow // 2
        cells = {"inflow": inflow, "unit 1": first, "unit 2": outflow - first - 8, "gates": 8, "level": level}
        row = [clock(second, CET, "%Y-%m-%dT%H:%M:%S") + "+01:00"]
        for name, value in cells.items():
            row += [f"{value:g}", "B" if (k, name) in bad else ""]
        lines.append(",".join(row))
    holes(truth, [(25, 1), (26, 2)])
    config = REACH + (
        'u_Qi = "inflow"\nu_Qo = ["unit 1", "unit 2", "gates"]\nh_L = "level"\n'
        'good = [""]\nmax_gap = 1800\n\n'
        '[input.quality]\nu_Qi = "inflow flag"\nu_Qo = ["unit 1 flag", "unit 2 flag", "gates flag"]\n'
        'h_L = "level flag"\n'
    )
    return Case({"plant.csv": joined(lines).encode()}, config, truth)


def hourly_means():
    """Hourly means of the inflow, stamped at their end, among rows of a quarter of an hour."""
    truth = world(MARCH, 2)
    moments = sorted(truth)
    for k, second in enumerate(moments):
        truth[second][0] = truth[moments[k // 4 * 4]][0]
    lines = ["time,inflow,outflow,level"]
    for k in range(len(moments) + 1):
        second = moments[0] + STEP * k
        inflow = f"{truth[second - 3600][0]}" if k % 4 == 0 and k else ""
        cells = plain(truth)[second][1:] if k < len(moments) else ["", ""]
        lines.append(",".join([clock(second, CET, "%Y-%m-%dT%H:%M:%S") + "+01:00", inflow, *cells]))
    for k, second in enumerate(moments):  # logged once an hour, it counts from the beginning of the hour
        if k % 4:
            truth[second][0] = None
    config = REACH + (
        'u_Qi = "inflow"\nu_Qo = "outflow"\nh_L = "level"\n\n[input.interval]\nu_Qi = 3600\n\n'
        '[input.stamp]\nu_Qi = "end"\n'
    )
    return Case({"means.csv": joined(lines).encode()}, config, truth)


def two_plants():
    """A historian's extract: the plant above in three parts, the dam below; titles above, averages below."""
    truth = world(MARCH, 2)
    texts, _ = rewritten(truth, (CFS, CFS, FT), ("{:.1f}", "{:,.1f}", "{:.2f}"))
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
    holes(meant, [(20, 0), (21, 2)])
    config = REACH + (
        'time = "Timestamp"\nu_Qi = ["UPR.G1.FLOW (cfs)", "UPR.G2.FLOW (cfs)", "UPR.GATES (cfs)"]\n'
        'u_Qo = "LWR.TOTAL.RELEASE (cfs)"\nh_L = "LWR.POND.ELEV (ft)"\n'
        'time_format = "%m/%d/%Y %I:%M:%S %p"\ntime_zone = "Etc/GMT-1"\nthousands = ","\nskip_rows = 3\n'
        'footer_rows = 2\nmissing = ["", "Bad Input", "I/O Timeout"]\nmax_gap = 1800\n\n'
        '[input.units]\nu_Qi = "cfs"\nu_Qo = "cfs"\nh_L = "ft"\n'
    )
    return Case({"extract.csv": joined(lines, "\r\n").encode()}, config, meant)


CASES = {
    f.__name__: f
    for f in (
        campbell, usgs, fews, zrxp, french, german, american, undecidable, utf16, historian, exception,
        tag_files, split, october, march, units_of_plant, hourly_means, two_plants,
    )
}  # fmt: skip
"""Every case by name."""


def expected_csv(expected):
    rows = ["second,u_Qi,u_Qo,h_L"]
    for second in sorted(expected):
        cells = ["" if value is None else repr(value) for value in expected[second]]
        rows.append(",".join([str(second), *cells]))
    return joined(rows).encode()


def contents(name):
    """All files of a case's folder."""
    case = CASES[name]()
    return {**case.files, "config.toml": case.config.encode(), "expected.csv": expected_csv(case.expected)}


def main():
    for name in CASES:
        shutil.rmtree(HERE / name, ignore_errors=True)
        (HERE / name).mkdir()
        for file, data in contents(name).items():
            (HERE / name / file).write_bytes(data)


if __name__ == "__main__":
    main()
