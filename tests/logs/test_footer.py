"""Test the last lines of an export without data: declared, counted, proposed, and never read as data."""

import datetime as dt
import gzip
import tomllib

import pytest

from rivid.config import Config, parse
from rivid.errors import ConfigError, PendingError, RividError
from rivid.logs.days import find_days, read_window
from rivid.logs.exports import ingest
from rivid.logs.sniff.propose import sniff
from tests.logs.helpers import DAY, config, read, rows

HEAD = "time,u_Qi,u_Qo,h_L"
FOOTER = ("Average,,,", '"*** End of report ***"')
REACH = {"sample_time": 300}


def lines(n=288):
    return [HEAD, *(",".join(row) for row in rows(n=n, step=300))]


def put(folder, *footer, n=288, ends="\n", newline="\n", encoding="utf-8", name=f"{DAY}.csv"):
    path = folder / name
    path.write_bytes((newline.join([*lines(n), *footer]) + ends).encode(encoding))
    return path


def text_of(path, **given):
    with pytest.raises(RividError) as caught:
        read(path, reach=REACH, **given)
    return str(caught.value)


@pytest.mark.parametrize("newline", ["\n", "\r\n", "\r"])
@pytest.mark.parametrize("encoding", ["utf-8", "utf-16", "latin-1"])
@pytest.mark.parametrize("end", [True, False])
def test_declared_lines_are_passed_over_and_counted(tmp_path, newline, encoding, end):
    path = put(
        tmp_path, *FOOTER[:1], "Écart: é", newline=newline, encoding=encoding, ends=newline if end else ""
    )
    data = read(path, reach=REACH, footer_rows=2, encoding=encoding)
    assert (len(data.inflow), data.n_filled, data.notes) == (288, 0, "2 footer rows dropped")
    plain = tmp_path / "plain"
    plain.mkdir()
    assert (read(put(plain), reach=REACH).output == data.output).all()


def test_undeclared_they_are_refused_with_the_key_and_the_number(tmp_path):
    path = put(tmp_path, *FOOTER)
    hint = "line 290: 'Average,,,': the last 2 lines are no data: set [input] footer_rows = 2"
    assert hint in text_of(path)
    assert "the last 2 lines are no data: set [input] footer_rows = 2" in text_of(path, footer_rows=1)
    one = put(tmp_path, FOOTER[1])
    assert "the last line is no data: set [input] footer_rows = 1" in text_of(one)


@pytest.mark.parametrize(
    "damaged",
    [
        "2008-03-10T23:55:00+01:00,300",  # too short
        "2008-03-10T23:55:61+01:00,300,290,118.5",  # invalid time
        "2008-03-10T23:55:00+01:00,x,290,118.5",  # not a number
    ],
)
def test_a_damaged_row_of_data_is_never_taken_for_a_footer(tmp_path, damaged):
    path = put(tmp_path, damaged, *FOOTER, n=287)
    message = text_of(path, footer_rows=3)
    assert "line 289" in message and "footer" not in message


@pytest.mark.parametrize("torn", ["2", "2008-", "2008-03-10T2", "2008-03-10T23:55:00+01:00,30"])
def test_a_last_row_that_is_being_written_is_no_footer(tmp_path, torn):
    path = put(tmp_path, torn, n=200, ends="")
    settings = config(REACH, footer_rows=2)
    (source,) = find_days(path, settings).days
    with pytest.raises(PendingError):
        read_window(path, [source], settings, today=DAY)


def test_a_format_that_fits_no_row_is_not_told_as_a_footer(tmp_path):
    few = tmp_path / f"{DAY}.csv"
    few.write_text("\n".join([HEAD, *(f"am Tag {h} um Eins,3,2,1" for h in range(12))]) + "\n")
    assert "set [input] time_format" in text_of(few)


def test_more_lines_than_any_footer_has_are_no_footer(tmp_path):
    path = put(tmp_path, *["remark"] * 30)
    assert "footer_rows" not in text_of(path) and "footer_rows" not in text_of(path, footer_rows=20)


def test_ingest_counts_them_and_loses_no_day(tmp_path):
    path = put(tmp_path, *FOOTER, name="export.csv")
    given = {"reach": REACH, "input": {"footer_rows": 2}}
    outcome = ingest([path], tmp_path / "logs", parse(given, Config))
    assert [day.status for day in outcome.days] == ["written"]
    assert outcome.ledger["files"][0]["footer_lines"] == 2
    assert outcome.ledger["sources"]["u_Qi"]["used"] == 288
    assert any("footer_rows): 2 passed over" in note for note in outcome.notes)
    undeclared = ingest([path], tmp_path / "others", parse({"reach": REACH}, Config))
    assert [day.status for day in undeclared.days] == ["refused"]
    assert "footer_rows = 2" in undeclared.days[0].reason


def test_a_long_table_has_a_footer_too(tmp_path):
    path = tmp_path / "long.csv"
    start = dt.datetime.combine(DAY, dt.time())
    body = [
        f"{(start + dt.timedelta(seconds=300 * k)).isoformat()}+01:00,{tag},{k % 7}"
        for k in range(288)
        for tag in ("u_Qi", "u_Qo", "h_L")
    ]
    path.write_text("\n".join(["time,tag,value", *body, "864 values", "end"]) + "\n")
    long = {"layout": "long", "tag": "tag"}
    result = ingest([path], tmp_path / "a", parse({"reach": REACH, "input": long}, Config))
    assert "'864 values': the last 2 lines are no data: set [input] footer_rows = 2" in result.days[0].reason
    whole = ingest(
        [path], tmp_path / "b", parse({"reach": REACH, "input": {**long, "footer_rows": 2}}, Config)
    )
    assert whole.exit_code == 0 and whole.ledger["files"][0]["footer_lines"] == 2


@pytest.mark.parametrize("encoding", ["utf-8", "utf-16", "utf-16-be"])
@pytest.mark.parametrize("packed", [False, True])
def test_sniff_proposes_and_says_them(tmp_path, encoding, packed):
    path = put(tmp_path, *FOOTER, encoding=encoding)
    if packed:
        path = tmp_path / "export.csv.gz"
        path.write_bytes(gzip.compress((tmp_path / f"{DAY}.csv").read_bytes()))
    proposal = sniff(path)
    assert tomllib.loads(proposal.toml)["input"]["footer_rows"] == 2
    assert "footer_rows" in dict(proposal.questions) and "'Average,,,'" in proposal.toml
    assert "footer_rows" not in sniff(put(tmp_path, encoding=encoding)).toml


def test_sniff_finds_the_end_of_a_file_that_it_does_not_read_whole(tmp_path):
    many = [line for k in range(80) for line in lines()[1:]]
    path = tmp_path / "big.csv"
    path.write_text("\n".join([HEAD, *many, *many, *many, *FOOTER]) + "\n")
    assert path.stat().st_size > 2 << 20
    assert tomllib.loads(sniff(path).toml)["input"]["footer_rows"] == 2


def test_the_key_has_a_limit_and_a_file_without_a_footer_loses_nothing(tmp_path):
    with pytest.raises(ConfigError, match="footer_rows"):
        config(REACH, footer_rows=21)
    data = read(put(tmp_path), reach=REACH, footer_rows=20)
    assert (data.n_filled, data.notes) == (0, "")
