"""Test formulas and markup from hostile names and cells, and names that lead outside OUT."""

import csv
import html.parser
import itertools
import os

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rivid.config import Config, parse
from rivid.errors import ConfigError
from rivid.results.store import FORMULA
from tests import examples
from tests.daily import FIRST, text_of, write_days
from tests.run.test_run import command, rivid

CELLS = (
    "=1+1", "=cmd|' /C calc'!A0", "+1+1", "-1+1", "@SUM(1;1)", "<script>alert(1)</script>",
    "<img src=x onerror=alert(1)>", "&lt;b&gt;", "{{ 7*7 }}", "' onmouseover='x", "\x1b[31mred",
)  # fmt: skip
NAMES = ("=1+1", "+x", "-2+3", "@SUM(1)", "<script>alert(1)", "{{7*7}}", "%s", "a;b", "'", "$(touch x)")


class Tags(html.parser.HTMLParser):
    """Collects the tags, attributes and text of a page."""

    def __init__(self, text):
        super().__init__()
        self.tags, self.attributes, self.text = set(), set(), ""
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        self.tags.add(tag)
        self.attributes |= {name for name, _ in attributes}

    def handle_data(self, data):
        self.text += data


def is_harmless(out):
    """Check that no cell of a CSV is a formula, and that no page runs code."""
    for path in out.rglob("*.csv"):
        with open(path, encoding="utf-8", newline="") as file:
            for cell in itertools.chain.from_iterable(csv.reader(file)):
                if cell.startswith(FORMULA):
                    float(cell)  # a number may begin with its sign
    pages = list(out.rglob("*.html"))
    assert pages
    for path in pages:
        page = Tags(path.read_text(encoding="utf-8"))
        assert page.tags.isdisjoint({"script", "iframe", "object", "embed"})
        assert not [name for name in page.attributes if name.startswith("on")]
    return Tags(pages[0].read_text(encoding="utf-8"))


def spoil(lines, row, cell):
    """Put a cell into the column of the inflow."""
    time, _, *rest = lines[row].split(",")
    lines[row] = ",".join([time, cell, *rest])
    return "\n".join(lines) + "\n"


def test_hostile_cells_and_file_names_end_as_text(tmp_path, tried):
    """The reason of a day quotes a cell, or begins with the name of a file of two days."""
    data, out = tmp_path / "data", tmp_path / "out"
    for date, cell in zip(write_days(data, len(CELLS)), CELLS, strict=True):
        (data / f"{date}.csv").write_text(
            spoil(text_of(date).splitlines(), 9, '"' + cell.replace('"', '""') + '"')
        )
    for k, name in enumerate(NAMES):
        days = [FIRST.replace(month=4, day=1 + 2 * k + j) for j in (0, 1)]
        lines = [*text_of(days[0]).splitlines(), *text_of(days[1]).splitlines()[1:]]
        (data / f"{name}.csv").write_text(spoil(lines, 700, "ERR"))
    done = command("run", data, "--out", out)
    assert done.returncode == 3, done.stderr
    page = is_harmless(out)
    assert "<script>alert(1)</script>" in page.text, "shown as what it is"
    assert "\x1b" not in done.stdout + done.stderr
    with open(out / "delays.csv", encoding="utf-8", newline="") as file:
        messages = [
            row["message"]
            for row in csv.DictReader(file)
            if (row["status"], row["estimator"]) == ("failed", "jmap")
        ]
    cells, names = messages[: len(CELLS)], messages[len(CELLS) :]
    assert all("which is no number" in message for message in cells)
    for name, message in zip(NAMES, names, strict=True):
        start = "'" + name if name.startswith(FORMULA) else name
        assert message.startswith(start + ".csv, line 701: column 'u_Qi' holds 'ERR'")
    tried("a cell of a log that is a formula, markup or a terminal's command", len(CELLS))
    tried("a log with a file name that is a formula, markup or a shell's command", len(NAMES))


def test_a_hostile_header_is_escaped_in_one_line(tmp_path, tried):
    (write,) = write_days(tmp_path, 1)
    path = tmp_path / f"{write}.csv"
    path.write_text(path.read_text().replace("time", "t\x0bme\x1b[31m", 1))
    done = command("check", tmp_path)
    assert done.returncode == 2 and "there are: t\\x0bme\\x1b[31m" in done.stderr
    assert len(done.stderr.splitlines()) == 1 and "\x1b" not in done.stderr
    tried("a header with a terminal's commands")


def test_hostile_names_of_reaches_of_a_fleet(tmp_path, tried):
    data = tmp_path / "data"
    names = [name for name in (*NAMES, "a b", "..x", "<b>") if "/" not in name]
    for name in names:
        write_days(data / name, 1)
    write_days(data / "sound", 2)
    done = command("run", data, "--out", tmp_path / "out", "--no-figures")
    assert done.returncode in (1, 2), done.stderr
    page = Tags((tmp_path / "out" / "fleet.html").read_text(encoding="utf-8"))
    assert page.tags.isdisjoint({"script", "b"}) and "<script>alert(1)" in page.text
    made = {path.name for path in (tmp_path / "out").iterdir() if path.is_dir()}
    assert "sound" in made and made.isdisjoint(set(names) - {"-2+3"})
    assert not (tmp_path / "x").exists()
    cells = [
        line.split(",")[0].strip('"') for line in (tmp_path / "out" / "fleet.csv").read_text().splitlines()
    ]
    assert not [cell for cell in cells if cell.startswith(("=", "+", "@", "-"))]
    tried("a fleet's directory with a name that is a formula, markup or a path", len(names))


DEVICES = ("CON", "NUL", "aux", "COM1", "LPT1.txt")
"""Names that are reserved on Windows."""
OPTIONS = ("-rf", "--help", "-", "--out=x", "...", "..x", ".hidden")


def test_names_of_devices_and_options_for_reaches_logs_and_directories(tmp_path, tried):
    """They are ordinary names or refused; nothing is written outside OUT, and no name acts as an option."""
    data, names = tmp_path / "data", (*DEVICES, *OPTIONS)
    for name in names:
        write_days(data / name, 1)
    done = command("run", data, "--out", tmp_path / "out", "--no-figures")
    assert done.returncode in (0, 2), done.stderr
    made = {path.name for path in (tmp_path / "out").iterdir() if path.is_dir()} - {".rivid"}
    assert {"CON", "-rf"} <= made <= set(names) and ".hidden" not in made
    assert {path.name for path in tmp_path.iterdir()} == {"data", "out"}
    tried("a reach with a directory called like a device of Windows, an option, or hidden", len(names))

    odd = tmp_path / "-logs"
    for k, name in enumerate(names):
        days = [FIRST.replace(day=1 + 2 * k + j) for j in (0, 1)]
        odd.mkdir(exist_ok=True)
        (odd / f"{name}.csv").write_text(text_of(days[0]) + text_of(days[1]).split("\n", 1)[1])
    done = command("run", "--no-figures", "--out", "-out", "--", "-logs", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    rows = (tmp_path / "-out" / "delays.csv").read_text().splitlines()
    assert len(rows) == 1 + 4 * sum(not name.startswith(".") for name in names)
    assert {path.name for path in tmp_path.iterdir()} == {"data", "out", "-logs", "-out"}
    assert command("check", "--", "-logs", cwd=tmp_path).returncode == 0
    tried(
        "a log called like a device, an option, or hidden, in a directory called like an option", len(names)
    )


@settings(max_examples=examples(300), deadline=None)
@given(st.text(max_size=90))
def test_a_reach_is_called_by_letters_digits_dot_underscore_hyphen(name):
    allowed = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789._-"
    try:
        config = parse({"reach": {"name": name}}, Config)
    except ConfigError as error:
        assert len(str(error).splitlines()) == 1
        assert not name or len(name) > 80 or name[0] == "." or not set(name) <= set(allowed)
    else:
        assert config.reach.name == name and set(name) <= set(allowed) and 0 < len(name) <= 80
        assert name[0] != "."


def test_a_name_that_leads_elsewhere_is_refused(tried):
    for name in ("..", ".", ".x", "../x", "/etc/x", "a/b", "x\n", "x\0", "ï", "=1", "C:\\x", ""):
        with pytest.raises(ConfigError):
            parse({"reach": {"name": name}}, Config)
        tried(f"reach.name = {name!r}")


def test_an_out_that_parquet_cannot_name_is_one_line(tmp_path, tried):
    write_days(tmp_path / "data", 1)
    done = command(
        "run", tmp_path / "data", "--out", os.fsdecode(bytes(tmp_path) + b"/caf\xe9"), "--no-figures"
    )
    assert done.returncode == 2 and len(done.stderr.splitlines()) == 1 and "not UTF-8" in done.stderr
    tried("OUT with a name that is not UTF-8")


def test_out_with_links_that_lead_out_writes_nothing_through_them(tmp_path, tried):
    """A written file replaces a link and does not follow it."""
    write_days(tmp_path / "data", 1)
    out, precious = tmp_path / "out", tmp_path / "precious"
    out.mkdir()
    precious.write_text("kept")
    names = ("delays.csv", "delays.parquet", "fir.parquet", "run.json", "report.html")
    for name in names:
        (out / name).symlink_to(precious)
    assert rivid("run", tmp_path / "data", "--out", out)[0] == 0
    assert precious.read_text() == "kept"
    assert not any((out / name).is_symlink() for name in names)
    tried("a file of OUT that is a link to another file", len(names))
