"""Test foreign exports: read when declared, refused with a hint when not, and proposed by sniff."""

import datetime as dt

import numpy as np
import pytest

from rivid.config import Config, load_config, parse
from rivid.errors import DataError, RividError
from rivid.logs.days import find_days, read_window
from rivid.logs.sniff.propose import sniff
from tests.logs.exports import EXPORTS, STEP, Export, N

REACH = {"sample_time": STEP}


class Utc(Export):
    """Seconds of UTC since 1970."""

    def time(self, k):
        midnight = dt.datetime.combine(self.date, dt.time(), dt.UTC)
        return str(int(midnight.timestamp()) + STEP * k)


EXPORTS = {**EXPORTS, "unix": Utc(**EXPORTS["unix"].__dict__)}
ZONE = {name: {} if name == "unix" else {"time_zone": "Etc/GMT-1"} for name in EXPORTS}


def write(folder, name):
    export = EXPORTS[name]
    path = folder / f"{export.date}.csv"
    path.write_bytes(export.to_bytes())
    return export, path


def read(path, settings):
    (source,) = find_days(path, settings).days
    return read_window(path, [source], settings)


def assert_true(data, export):
    inflow, outflow, level = export.truth()
    for j, (got, true) in enumerate([(data.inflow, inflow), (data.outflow, outflow), (data.output, level)]):
        sound = np.array([(k, j) not in export.holes for k in range(N)])
        # three decimals in the log's unit
        np.testing.assert_allclose(
            got[sound], true[sound], atol=0.51e-3 * max(export.factors[j], 1e-3), rtol=1e-12
        )
    assert data.n_filled == len({k for k, _ in export.holes})


@pytest.mark.parametrize("name", EXPORTS)
def test_a_declared_export_is_read(tmp_path, name):
    export, path = write(tmp_path, name)
    settings = parse({"reach": REACH, "input": {**export.declared, **ZONE[name]}}, Config)
    assert_true(read(path, settings), export)


@pytest.mark.parametrize("name", EXPORTS)
def test_what_sniff_proposes_reads_the_file_it_came_from(tmp_path, name):
    export, path = write(tmp_path, name)
    proposal = sniff(path, ZONE[name].get("time_zone"))
    config = tmp_path / "proposed.toml"
    config.write_text(proposal.toml, encoding="utf-8")
    settings = load_config(config)
    assert settings.reach.sample_time == STEP
    assert_true(read(path, settings), export)


HINTS = {
    "french": 'not UTF-8: set [input] encoding',
    "utf-16": 'set [input] encoding = "utf-16"',
    "american": "nearest is",
    "thousands": 'set [input] separator = ";"',
    "preamble": 'set [input] separator = ";"',
    "sentinels and status": "set [input] sentinels = [-999]",
    "date and clock": "no column 'time'",
    "quoted commas": 'set [input] decimal = ","',
    "unix": "there are: timestamp, u_Qi",
}  # fmt: skip


@pytest.mark.parametrize("name", HINTS)
def test_an_undeclared_export_is_refused_with_what_to_declare(tmp_path, name):
    _, path = write(tmp_path, name)
    with pytest.raises(DataError) as caught:
        read(path, parse({"reach": REACH, "input": {"time_zone": "Etc/GMT-1"}}, Config))
    assert HINTS[name] in str(caught.value)


@pytest.mark.parametrize(
    ("name", "left_out", "hint"),
    [
        ("french", "decimal", 'set [input] decimal = ","'),
        ("french", "time_format", "is no time of ISO 8601: set [input] time_format"),
        ("thousands", "thousands", 'set [input] thousands = ","'),
        ("german", "unit_rows", "looks like a row of units: set [input] unit_rows = 1"),
        ("preamble", "skip_rows", "no column 'time' for time"),
        ("sentinels and status", "missing", 'add "Eqp" to [input] missing'),
        ("sentinels and status", "sentinels", "column 'h_L' holds -999 2 times, far from the day's 11"),
        ("hour 24", "time_format", "is no time of ISO 8601"),
    ],
)
def test_each_declaration_left_out_is_asked_for(tmp_path, name, left_out, hint):
    export, path = write(tmp_path, name)
    given = {k: v for k, v in export.declared.items() if k != left_out}
    with pytest.raises(DataError) as caught:
        read(path, parse({"reach": REACH, "input": {"time_zone": "Etc/GMT-1", **given}}, Config))
    assert hint in str(caught.value)


def test_a_repeated_header_is_refused_or_dropped(tmp_path):
    lines = EXPORTS["plain"].to_bytes().decode().splitlines()
    lines.insert(100, lines[0])
    path = tmp_path / "2008-03-10.csv"
    path.write_text("\n".join(lines) + "\n")
    given = {"time_zone": "Etc/GMT-1"}
    with pytest.raises(
        DataError, match=r'line 101: the header again: .* set \[input\] repeated_header = "drop"'
    ):
        read(path, parse({"reach": REACH, "input": given}, Config))
    data = read(path, parse({"reach": REACH, "input": {**given, "repeated_header": "drop"}}, Config))
    assert data.notes == "1 repeated headers dropped"


@pytest.mark.parametrize("name", ["french", "german", "date and clock", "thousands"])
def test_a_title_padded_with_separators_is_not_taken_for_the_header(tmp_path, name):
    export, path = write(tmp_path, name)
    mark = export.separator
    width = path.read_bytes().decode(export.encoding).splitlines()[0].count(mark)
    title = ["Export SCADA" + mark * width, "Station" + mark + "Isere" + mark * (width - 1), mark * width]
    before = (export.newline.join(title) + export.newline).encode(export.encoding)
    path.write_bytes(before + path.read_bytes())
    config = tmp_path / "proposed.toml"
    config.write_text(sniff(path, "Etc/GMT-1").toml, encoding="utf-8")
    settings = load_config(config)
    assert settings.input.skip_rows == 3
    assert_true(read(path, settings), export)


@pytest.mark.parametrize("ends", [True, False])
@pytest.mark.parametrize("name", ["plain", "french", "date and clock"])
def test_rows_of_empty_cells_are_skipped_and_counted(tmp_path, name, ends):
    export, path = write(tmp_path, name)
    content = path.read_bytes().decode(export.encoding)
    empty = export.separator * content.splitlines()[0].count(export.separator)
    content += export.newline.join([empty, " " + empty, empty]) + (export.newline if ends else "")
    path.write_bytes(content.encode(export.encoding))
    settings = parse({"reach": REACH, "input": {**export.declared, **ZONE[name]}}, Config)
    data = read(path, settings)
    assert_true(data, export)
    assert data.notes == "3 empty rows dropped"
    config = tmp_path / "proposed.toml"
    config.write_text(sniff(path, "Etc/GMT-1").toml, encoding="utf-8")
    assert_true(read(path, load_config(config)), export)


def test_times_without_offset_need_a_zone(tmp_path):
    _, path = write(tmp_path, "plain")
    with pytest.raises(DataError, match=r"have no UTC offset: set the zone .* \[input\] time_zone"):
        read(path, parse({"reach": REACH}, Config))


@pytest.mark.parametrize(
    ("text", "time_format"),
    [
        ("{:02d}-Feb-23 13:00", "%d-%b-%y %H:%M"),
        ("{:02d}-Feb-2023 01:00 PM", "%d-%b-%Y %I:%M %p"),
        ("{:02d}.02.2023 09:58:00,100", "%d.%m.%Y %H:%M:%S,%f"),
    ],
)
def test_names_of_months_and_fractions_behind_a_comma_are_read(tmp_path, text, time_format):
    rows = [f"{text.format(d)};{d};3;1" for d in range(1, 29)]
    (tmp_path / "export.csv").write_text("\n".join(["time;inflow;outflow;level", *rows]) + "\n")
    assert f'time_format = "{time_format}"' in sniff(tmp_path / "export.csv", "UTC").toml


@pytest.mark.parametrize(
    ("name", "zone"), [("Time (UTC)", "UTC"), ("Zeit [UTC+1]", "Etc/GMT-1"), ("time GMT-08:00", "Etc/GMT+8")]
)
def test_a_zone_in_the_name_of_the_times_is_proposed(tmp_path, name, zone):
    rows = [f"2024-04-03 {h:02d}:00,{h},3,1" for h in range(24)]
    (tmp_path / "export.csv").write_text("\n".join([f"{name},inflow,outflow,level", *rows]) + "\n")
    proposal = sniff(tmp_path / "export.csv")
    assert f'time_zone = "{zone}"' in proposal.toml and "time_zone" in dict(proposal.questions)
    assert f'time_zone = "{zone}"' not in sniff(tmp_path / "export.csv", "Europe/Oslo").toml


class TestWhatSniffCannotTell:
    def propose(self, tmp_path, text, name="export.csv"):
        (tmp_path / name).write_text(text)
        return sniff(tmp_path / name)

    @pytest.mark.parametrize(
        ("row", "open_key", "is_open"),
        [
            ("03/04/2024 {h:02d}:00;3;1", "time_format", True),
            ("0{d}/04/2024 {h:02d}:00;3;1", "time_format", False),  # consecutive days
            ("2024-04-03T{h:02d}:00;3;1", "time_zone", True),
            ("2024-04-03T{h:02d}:00Z;3;1", "time_zone", False),
            ("2024-04-03T{h:02d}:00;1,23{k};4", "decimal", True),
            ("2024-04-03T{h:02d}:00;1.23{k};4.000", "decimal", True),
            ("2024-04-03T{h:02d}:00;31{k};4.000", "decimal", False),
        ],
    )
    def test_doubtful_cells_leave_their_key_open(self, tmp_path, row, open_key, is_open):
        days = (3, 4) if "{d}" in row else (3,)
        rows = [row.format(d=d, h=h, k=h % 10) for d in days for h in range(24)]
        proposal = self.propose(tmp_path, "\n".join(["time;inflow;level", *rows]) + "\n")
        assert (open_key in dict(proposal.questions)) == is_open
        if open_key == "time_format":
            assert ('time_format = "%d/%m/%Y %H:%M"' in proposal.toml.replace("# time_format", "")) != is_open

    @pytest.mark.parametrize(
        "text", ["", "\n\n", ",", "no table here\nat all\n", "1;2\n3;4\n", "a;b\n", "a;b\nx;y\nz;w\n"]
    )
    def test_no_table_is_said_to_be_none(self, tmp_path, text):
        with pytest.raises(RividError, match="export.csv"):
            self.propose(tmp_path, text)

    def test_a_hostile_name_stays_in_its_comment(self, tmp_path):
        rows = "".join(f"2024-04-03T{h:02d}:00Z,3,1\n" for h in range(24))
        proposal = self.propose(tmp_path, 'time,inflow,"le""vel\x1b"\n' + rows, name="a\nb = 1.csv")
        (tmp_path / "c.toml").write_text(proposal.toml)
        assert load_config(tmp_path / "c.toml").input.u_Qi == "inflow"
