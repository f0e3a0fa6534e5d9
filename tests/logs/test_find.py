"""Test that days are found by name or by content, and recognised by content."""

import datetime as dt
import gzip
import json
import os
import pickle
import shutil

import pytest

from rivid.errors import ConfigError, NoDataError
from rivid.logs.days import FileFacts, find_days, read_window, refuse_columns
from tests.daily import text_of, write_days
from tests.logs.helpers import DAY, HEAD, config, rows, text

NEXT = DAY + dt.timedelta(days=1)


@pytest.fixture
def many(tmp_path):
    """Write three days in one file, and the same days in three files."""
    write_days(tmp_path / "single", 3)
    parts = [text_of(DAY + dt.timedelta(days=k)).split("\n", 1)[1] for k in range(3)]
    (tmp_path / "many").mkdir()
    (tmp_path / "many" / "march.csv").write_text(HEAD + "\n" + "".join(parts))
    return tmp_path


def test_days_come_in_order_and_other_files_are_passed_over(tmp_path):
    write_days(tmp_path, 3)
    (tmp_path / "2008-03-13.csv.gz").write_bytes(gzip.compress(text_of(dt.date(2008, 3, 13)).encode()))
    (tmp_path / "README.md").write_text("# about")
    (tmp_path / ".2008-03-01.csv").write_text("half")
    (tmp_path / "2008-03-02.xlsx").write_text("?")
    (tmp_path / "2008-03-03.csv").mkdir()
    catalog = find_days(tmp_path, config())
    assert [str(d.date) for d in catalog.days] == ["2008-03-10", "2008-03-11", "2008-03-12", "2008-03-13"]
    assert catalog.bad_files == [("2008-03-03.csv", "is a directory: expected a file")]


def test_a_source_is_small_to_send(tmp_path):
    write_days(tmp_path, 1)
    (source,) = find_days(tmp_path, config()).days
    assert pickle.loads(pickle.dumps(source)) == source
    assert len(pickle.dumps(source)) < 400


def test_a_file_of_many_days_reads_like_files_of_one(many):
    one, all_days = find_days(many / "single", config()), find_days(many / "many", config())
    assert [d.date for d in one.days] == [d.date for d in all_days.days]
    for a, b in zip(one.days, all_days.days, strict=True):
        first, second = read_window(many / "single", [a], config()), read_window(many / "many", [b], config())
        for name in ("inflow", "outflow", "output"):
            assert (getattr(first, name) == getattr(second, name)).all()
        assert second.notes == "" and second.n_filled == 0


def test_a_single_file_can_be_the_data(many):
    file = many / "many" / "march.csv"
    shutil.copy(many / "single" / "2008-03-10.csv", many / "many")
    catalog = find_days(file, config())
    assert [len(d.parts) for d in catalog.days] == [1, 1, 1]
    assert len(read_window(file, catalog.days[1:2], config()).inflow) == 650


def digests(catalog):
    return [(day.date, [(path, digest) for path, digest, _ in day.parts]) for day in catalog.days]


def test_appending_a_day_leaves_the_others_digests(many):
    file = many / "many" / "march.csv"
    before = find_days(many / "many", config())
    with file.open("a") as handle:
        handle.write(text_of(DAY + dt.timedelta(days=3)).split("\n", 1)[1])
    after = find_days(many / "many", config())
    assert len(after.days) == 4
    assert digests(after)[:3] == digests(before)


def test_changing_one_cell_changes_one_day(many):
    file = many / "many" / "march.csv"
    before = find_days(many / "many", config())
    lines = file.read_text().split("\n")
    cells = lines[700].split(",")
    assert cells[0].startswith(str(NEXT))
    lines[700] = ",".join([cells[0], "999", *cells[2:]])
    file.write_text("\n".join(lines))
    after = find_days(many / "many", config())
    changed = [a[0] for a, b in zip(digests(after), digests(before), strict=True) if a != b]
    assert changed == [NEXT]


def test_known_files_are_neither_hashed_nor_opened(many, monkeypatch):
    before = find_days(many / "many", config())
    known = {name: FileFacts(**json.loads(json.dumps(vars(facts)))) for name, facts in before.files.items()}
    monkeypatch.setattr("rivid.logs.days.load", None)
    assert find_days(many / "many", config(), known).days == before.days
    monkeypatch.undo()
    before = find_days(many / "single", config())
    monkeypatch.setattr("rivid.logs.days._hash", None)
    assert find_days(many / "single", config(), before.files).days == before.days
    with pytest.raises(TypeError):  # it hashes only on request
        find_days(many / "single", config(), before.files, verify=True)


def test_a_change_is_found_where_size_and_modification_time_are_restored(tmp_path):
    write_days(tmp_path, 1)
    before = find_days(tmp_path, config())
    file = tmp_path / "2008-03-10.csv"
    status = file.stat()
    file.write_text(file.read_text().replace("118.0", "117.0", 1))
    os.utime(file, ns=(status.st_atime_ns, status.st_mtime_ns))
    assert find_days(tmp_path, config(), before.files).days != before.days
    assert find_days(tmp_path, config(), before.files, verify=True).days != before.days


def test_what_is_known_of_many_days_holds_for_the_same_settings_only(many):
    before = find_days(many / "many", config())
    after = find_days(many / "many", config(time_zone="Asia/Tokyo"), before.files)
    assert [d.date for d in after.days] == [DAY + dt.timedelta(days=k) for k in range(4)]


def test_a_log_that_changes_between_listing_and_reading_is_refused(tmp_path):
    write_days(tmp_path, 1)
    catalog = find_days(tmp_path, config())
    (tmp_path / "2008-03-10.csv").write_text(text_of(DAY, seed=5))
    with pytest.raises(Exception, match="not what it was when it was listed"):
        read_window(tmp_path, catalog.days, config())


def test_two_files_of_one_day_must_agree(tmp_path):
    write_days(tmp_path, 1)
    lines = rows()
    (tmp_path / "extra.csv").write_text(text(lines[300:]))
    (source,) = find_days(tmp_path, config()).days
    assert len(source.parts) == 2
    data = read_window(tmp_path, [source], config())
    assert "350 values of h_L in two files" in data.notes
    lines[400][3] = "99"
    (tmp_path / "extra.csv").write_text(text(lines[300:]))
    with pytest.raises(
        Exception, match=r"2008-03-10.csv and extra.csv disagree about h_L at 2008-03-10 14:46:40"
    ):
        read_window(tmp_path, find_days(tmp_path, config()).days, config())


@pytest.mark.parametrize("what", ["missing", "empty", "text"])
def test_nothing_to_read_reports_what_was_looked_for(tmp_path, what):
    root = tmp_path / "logs"
    if what == "empty":
        root.mkdir()
    if what == "text":
        root.write_text("not a log")
    with pytest.raises(NoDataError, match="logs") as caught:
        find_days(root, config())
    assert str(root) in str(caught.value)


def test_logs_two_directories_down_are_pointed_to(tmp_path):
    write_days(tmp_path / "2008-03" / "a", 1)
    found = rf"no logs in {tmp_path} itself: .* `rivid ingest {tmp_path}/\*/\*/\*.csv --config"
    with pytest.raises(NoDataError, match=found):
        find_days(tmp_path, config())


def test_only_bad_files_say_what_is_wrong_with_the_first(tmp_path):
    (tmp_path / "export.csv").write_text("a;b\n1;2\n")
    with pytest.raises(
        NoDataError, match=r'export.csv: line 1: no column .time. .* set \[input\] separator = ";"'
    ):
        find_days(tmp_path, config())


class TestColumnsThatNoLogHas:
    def test_all_logs_lack_it_so_the_configuration_is_wrong(self, tmp_path):
        write_days(tmp_path, 4)
        settings = config(u_Qo="u_Qout")
        with pytest.raises(
            ConfigError, match=r"2008-03-10.csv, line 1: no column 'u_Qout' for u_Qo; nearest is 'u_Qo'"
        ):
            refuse_columns(tmp_path, find_days(tmp_path, settings).days, settings)

    def test_one_log_lacks_it_so_its_day_fails(self, tmp_path):
        write_days(tmp_path, 4)
        (tmp_path / "2008-03-13.csv").write_text(text(rows(dt.date(2008, 3, 13)), head="time,u_Qi,q_out,h_L"))
        refuse_columns(tmp_path, find_days(tmp_path, config()).days, config())

    def test_logs_with_other_faults_are_left_to_their_days(self, tmp_path):
        write_days(tmp_path, 4)
        for file in tmp_path.iterdir():
            file.write_bytes(b"")
        refuse_columns(tmp_path, find_days(tmp_path, config()).days, config())
