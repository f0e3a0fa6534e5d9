"""The files of a diagnosis: what is in them, the same bytes twice, all or nothing."""

import datetime as dt
import json

import numpy as np
import pyarrow.parquet as pq
import pytest

from rivid.diagnosis.result import VERDICTS
from rivid.errors import RividError
from rivid.report.diagnosis_files import write_diagnosis
from tests.diagnosis.answers import diagnosis, evidence_of, record_of

EVIDENCE = evidence_of(gone=(13,))
ALL = ["diagnosis_day.png", "diagnosis_gap.png", "diagnosis_inflow.png", "diagnosis_map.png"]


@pytest.fixture(scope="module")
def out(tmp_path_factory):
    folder = tmp_path_factory.mktemp("out")
    write_diagnosis(folder, diagnosis("explained", EVIDENCE), EVIDENCE, reach="basse_isere")
    return folder


def test_the_files_are_those_of_the_contract(out):
    assert sorted(p.name for p in out.iterdir()) == [
        "diagnosis.html", "diagnosis.json", "figures", "unexplained_inflow.parquet"
    ]  # fmt: skip
    assert sorted(p.name for p in (out / "figures").iterdir()) == ALL


def test_the_answer_is_json_with_the_names_of_the_contract(out):
    said = json.loads((out / "diagnosis.json").read_text(encoding="utf-8"))
    assert said["verdict"] == "explained" and said["effects"][0]["name"] == "diurnal_inflow"
    assert said["gap"]["horizon_h"] == [1.0, 4.0, 24.0]
    assert (out / "diagnosis.json").read_text(encoding="utf-8") == diagnosis("explained", EVIDENCE).to_json()


def test_the_unexplained_inflow_has_a_row_for_each_sample_that_counts(out):
    table = pq.read_table(out / "unexplained_inflow.parquet")
    record = EVIDENCE.record
    assert table.column_names == [
        "time", "w_m3s", "low", "high", "w_before_m3s", "low_before", "high_before"
    ]  # fmt: skip
    assert len(table) == record.used.sum() < record.used.size
    rows = iter(table.to_pylist())
    midnight = dt.datetime.combine(record.dates[0], dt.time())
    for i, k in np.argwhere(record.used):
        row = next(rows)
        if k % 17:
            continue
        day = dt.datetime.combine(record.dates[i], dt.time())
        assert row["time"] == day + dt.timedelta(seconds=(k - record.lead) * record.sample_time)
        assert row["time"] == midnight + dt.timedelta(seconds=record.time[i, k])
        assert row["w_m3s"] == EVIDENCE.inflow_after[i, k]
        assert row["w_before_m3s"] == EVIDENCE.inflow_before[i, k]
        assert row["high"] - row["low"] == pytest.approx(2 * 1.959964 * EVIDENCE.inflow_after_sd[i, k])
        assert row["high_before"] + row["low_before"] == pytest.approx(2 * row["w_before_m3s"])


def test_times_grow_and_none_comes_twice(out):
    times = pq.read_table(out / "unexplained_inflow.parquet")["time"].to_numpy()
    assert (np.diff(times) > np.timedelta64(0)).all()


@pytest.mark.parametrize("verdict", ["partly_explained", "unknown"])
@pytest.mark.parametrize("kind", ["pool", "river"])
def test_the_same_answer_gives_the_same_bytes(verdict, kind, tmp_path):
    evidence = evidence_of(record_of(kind=kind))
    answer = diagnosis(verdict, evidence)
    for name in ("a", "b"):
        write_diagnosis(tmp_path / name, answer, evidence, reach="r")
    files = sorted(p.relative_to(tmp_path / "a") for p in (tmp_path / "a").rglob("*") if p.is_file())
    assert len(files) == 7
    for file in files:
        assert (tmp_path / "a" / file).read_bytes() == (tmp_path / "b" / file).read_bytes(), file


@pytest.mark.parametrize("verdict", VERDICTS)
def test_every_verdict_can_be_written_over_the_one_before(verdict, out, tmp_path):
    write_diagnosis(tmp_path, diagnosis("explained", EVIDENCE), EVIDENCE, draw=False)
    evidence = None if verdict == "insufficient_data" else EVIDENCE
    page = write_diagnosis(tmp_path, diagnosis(verdict, EVIDENCE), evidence, draw=False)
    assert page == tmp_path / "diagnosis.html"
    assert json.loads((tmp_path / "diagnosis.json").read_text())["verdict"] == verdict
    rows = pq.read_table(tmp_path / "unexplained_inflow.parquet")
    assert rows.schema == pq.read_schema(out / "unexplained_inflow.parquet")
    assert len(rows) == (0 if evidence is None else EVIDENCE.record.used.sum())


def test_without_pictures_those_of_an_earlier_diagnosis_go_and_other_files_stay(tmp_path):
    answer = diagnosis("no_gap", EVIDENCE)
    write_diagnosis(tmp_path, answer, EVIDENCE)
    (tmp_path / "figures" / "tdr_jmap.png").write_bytes(b"theirs")
    (tmp_path / "delays.csv").write_text("theirs")
    page = write_diagnosis(tmp_path, answer, EVIDENCE, draw=False)
    assert [p.name for p in (tmp_path / "figures").iterdir()] == ["tdr_jmap.png"]
    assert (tmp_path / "delays.csv").read_text() == "theirs"
    assert "<img" not in page.read_text(encoding="utf-8")


def test_inflow_that_is_not_known_is_an_empty_cell(tmp_path):
    evidence = evidence_of()
    evidence.inflow_after[4, 60] = np.nan
    write_diagnosis(tmp_path, diagnosis("no_gap", evidence), evidence, draw=False)
    column = pq.read_table(tmp_path / "unexplained_inflow.parquet")["w_m3s"]
    assert evidence.record.used[4, 60] and column.null_count == 1


def test_no_part_of_a_file_is_left_behind_where_the_disk_refuses(tmp_path):
    (tmp_path / "diagnosis.html").mkdir()
    with pytest.raises(RividError, match="cannot write .*diagnosis.html") as error:
        write_diagnosis(tmp_path, diagnosis("no_gap", EVIDENCE), EVIDENCE, draw=False)
    assert "\n" not in str(error.value)
    assert not [p for p in tmp_path.rglob("*.part")]
    assert not (tmp_path / "diagnosis.json").exists(), "the answer comes last"
