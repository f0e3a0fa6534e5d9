"""Test the proposals of sniff for the corpus: right if it is certain, otherwise a question."""

import datetime as dt
import tomllib
from zoneinfo import ZoneInfo

import numpy as np
import pytest
from click.testing import CliRunner

from rivid.cli import cli
from rivid.config import Config, load_config, parse
from rivid.errors import RividError
from rivid.input_config import USUAL_ZONES
from rivid.logs.days import find_days, read_window
from rivid.logs.exports import ingest
from rivid.logs.sniff.propose import sniff
from tests.test_ingest_corpus import CASES, HERE, differences, expected_of, files_of, found_in

ANSWERS = {
    "exception": {"hold": {"u_Qi": 3600, "u_Qo": 3600, "h_L": 3600}},
    "hourly_means": {"stamp": {"u_Qi": "end"}},
    "two_plants": {
        "u_Qi": ["UPR.G1.FLOW (cfs)", "UPR.G2.FLOW (cfs)", "UPR.GATES (cfs)"],
        "u_Qo": "LWR.TOTAL.RELEASE (cfs)",
    },
    "undecidable": {"time_format": "%d/%m/%Y %H:%M"},
    "units_of_plant": {"u_Qo": ["unit 1", "unit 2", "gates"]},
    "usgs": {"u_Qi": "111_00060", "u_Qo": "222_00060"},
    "zrxp": {"u_Qi": "UPPER.Q", "u_Qo": "LOWER.Q"},
    "tag_files": {"u_Qi": "UP_Q", "u_Qo": "DN_Q"},
}
"""Keys that operators must answer. The other cases need the zone only, which each is given."""


def zone_of(name):
    return load_config(HERE / name / "config.toml").input.time_zone


def gaps_of(name):
    """Return the share that may be missing: a choice, not a property of the file."""
    given = load_config(HERE / name / "config.toml")
    return {"max_gap": given.input.max_gap}


def outcome_of(name, raw, tmp_path):
    raw = {**raw, "input": {**raw["input"], **gaps_of(name)}, "reach": {"sample_time": 900, **raw["reach"]}}
    return ingest(files_of(name), tmp_path / "logs", parse(raw, Config))


@pytest.mark.parametrize("name", CASES)
def test_a_proposal_with_the_open_keys_answered_reads_every_value(name, tmp_path):
    """Cases without answers are read by the proposal alone."""
    proposal, answers = sniff(files_of(name), zone_of(name)), ANSWERS.get(name, {})
    raw = tomllib.loads(proposal.toml)
    assert set(answers) <= dict(proposal.questions).keys(), proposal.toml
    raw["input"] |= answers
    outcome = outcome_of(name, raw, tmp_path)
    assert outcome.exit_code == 0, [day.reason for day in outcome.days] + [proposal.toml]
    found, expected = found_in(tmp_path / "logs"), expected_of(name)
    assert differences(found, expected) == []
    n_found, n_measured = (sum(v is not None for row in x.values() for v in row) for x in (found, expected))
    assert n_found == n_measured


@pytest.mark.parametrize("name", ANSWERS)
def test_a_proposal_is_wrong_only_in_keys_that_are_open(name, tmp_path):
    proposal = sniff(files_of(name), zone_of(name))
    try:
        outcome = outcome_of(name, tomllib.loads(proposal.toml), tmp_path)
    except RividError as error:
        assert error.exit_code == 2 and "\n" not in str(error)
        return
    wrong = differences(found_in(tmp_path / "logs"), expected_of(name))
    assert not wrong or any(key in dict(proposal.questions) for key in ANSWERS[name])
    assert outcome.days


@pytest.mark.parametrize("name", [name for name in CASES if zone_of(name)])
def test_without_a_zone_it_is_asked_for_and_nothing_is_read(name, tmp_path):
    proposal = sniff(files_of(name))
    if name in ("zrxp", "historian", "ogc_json"):  # TZUTC+1 in its header; an offset after each time
        assert "time_zone" not in dict(proposal.questions)
        return
    assert "time_zone" in dict(proposal.questions)
    with pytest.raises(RividError, match="time_zone|time_format|input"):
        outcome = outcome_of(name, tomllib.loads(proposal.toml), tmp_path)
        assert all(day.status == "refused" for day in outcome.days)
        raise RividError(outcome.days[0].reason)


def test_two_readings_of_a_date_are_left_to_choose_in_a_comment():
    (path,) = files_of("undecidable")
    proposal = sniff(path, "Etc/GMT-1")
    assert '# time_format = "%d/%m/%Y %H:%M" or "%m/%d/%Y %H:%M": choose one' in proposal.toml
    assert "time_format" not in tomllib.loads(proposal.toml)["input"]
    assert {"time_format", "units", "stamp"} <= dict(proposal.questions).keys()


def test_units_that_no_word_states_are_asked_for():
    (path,) = files_of("historian")
    proposal = sniff(path)
    assert "units" in dict(proposal.questions)
    assert "no unit is written for u_Qi: m3/s is taken" in proposal.toml
    (path,) = files_of("french")
    assert "units" not in dict(sniff(path, "Etc/GMT-1").questions)


def test_flags_are_shown_and_only_those_known_or_common_are_taken_as_good():
    (path,) = files_of("usgs")
    proposal = sniff(path, "America/Denver")
    raw = tomllib.loads(proposal.toml)["input"]
    assert raw["good"] == ["A"] and "good" in dict(proposal.questions)
    assert raw["quality"] == {"u_Qi": "111_00060_cd", "u_Qo": "222_00060_cd", "h_L": "333_00065_cd"}
    assert raw["zones"] == {"MDT": "-06:00", "MST": "-07:00"}


def test_what_operators_must_fill_in_stands_in_comments_of_a_block_that_ends_with_an_empty_line():
    (path,) = files_of("american")
    proposal = sniff(path, "Etc/GMT-1").toml
    block = proposal[proposal.index("[reach]\n") : proposal.index("\n\n")]
    for key in ("name", "length", "width", "depth", "surface_area", "discharge_range"):
        assert f"\n# {key} = " in block
    assert tomllib.loads(block) == {"reach": {"kind": "pool", "sample_time": 900}}
    filled = block.replace("# length =  ", "length = 15000").replace('# name = "..."', 'name = "lower-river"')
    assert parse(tomllib.loads(filled), Config).reach.length == 15000


def test_the_question_on_the_stamp_states_how_much_it_matters():
    (path,) = files_of("american")
    (question,) = [q for _, q in sniff(path, "Etc/GMT-1").questions if "[input.stamp]" in q]
    assert "up to one interval (900 s)" in question


def test_choices_in_comments_are_valid_toml_in_eighty_columns():
    (path,) = files_of("two_plants")
    result = CliRunner().invoke(cli, ["sniff", str(path)], standalone_mode=False)
    assert max(map(len, result.output.splitlines())) <= 80
    lines = result.output.splitlines()
    at = next(i for i, line in enumerate(lines) if line.startswith("# u_Qo = ["))
    end = next(i for i, line in enumerate(lines) if i >= at and line.endswith("]"))
    chosen = tomllib.loads("\n".join(line[2:] for line in lines[at : end + 1]))
    assert chosen == {"u_Qo": ANSWERS["two_plants"]["u_Qi"]}


@pytest.mark.parametrize(
    ("given", "near"),
    [
        ("PST", "near: America/Los_Angeles;"),
        ("Pacific Standard Time", "near: America/Los_Angeles;"),
        ("Eastern", "near: America/New_York;"),
        ("MEZ", "near: Europe/Berlin;"),
        ("Europe/Pariss", "near: Europe/Paris;"),
        ("los angeles", "near: America/Los_Angeles;"),
        ("xyzzy", "America/Los_Angeles or UTC; Etc/GMT"),
    ],
)
def test_a_zone_that_is_none_is_refused_with_those_near_and_the_sign_of_etc(given, near):
    (path,) = files_of("american")
    result = CliRunner().invoke(cli, ["sniff", str(path), "--time-zone", given], standalone_mode=False)
    assert isinstance(result.exception, RividError) and near in str(result.exception)
    assert "Etc/GMT+8 is 8 h behind UTC" in str(result.exception) and "\n" not in str(result.exception)


def test_the_sign_of_etc_zones_is_as_stated():
    noon = dt.datetime(2024, 6, 3, 12, tzinfo=ZoneInfo("Etc/GMT+8"))
    assert noon.utcoffset() == dt.timedelta(hours=-8)
    assert all(ZoneInfo(zone).key == zone for zone in USUAL_ZONES.values())


@pytest.mark.parametrize("name", ["american", "french", "two_plants", "historian"])
def test_reading_an_export_without_its_declaration_points_to_sniff(name, tmp_path):
    (path,) = files_of(name)
    done = CliRunner().invoke(cli, ["check", str(path)], standalone_mode=False)
    assert isinstance(done.exception, RividError)
    assert "`rivid sniff FILE` proposes" in str(done.exception) or "encoding" in str(done.exception)


def test_a_directory_of_wide_exports_is_read_without_ingest(tmp_path):
    (path,) = files_of("two_plants")
    (tmp_path / "exports").mkdir()
    (tmp_path / "exports" / path.name).write_bytes(path.read_bytes())
    config = load_config(HERE / "two_plants" / "config.toml")
    outcome = ingest([path], tmp_path / "logs", config)
    straight, made = find_days(tmp_path / "exports", config).days, find_days(tmp_path / "logs", config).days
    assert [d.date for d in straight] == [d.date for d in made] == [d.date for d in outcome.days]
    read = load_config(outcome.run_config)
    for a, b in zip(straight, made, strict=True):
        one = read_window(tmp_path / "exports", [a], config)
        two = read_window(tmp_path / "logs", [b], read)
        for x, y in ((one.inflow, two.inflow), (one.outflow, two.outflow), (one.output, two.output)):
            np.testing.assert_allclose(x, y, rtol=1e-12)


def test_the_command_takes_files_that_belong_together(tmp_path):
    words = [*map(str, files_of("split"))]
    result = CliRunner().invoke(cli, ["sniff", *words], standalone_mode=False)
    assert result.return_value == 0
    (tmp_path / "c.toml").write_text(result.output)
    given = load_config(tmp_path / "c.toml").input
    assert (given.u_Qi, given.u_Qo, given.h_L) == ("inflow", "outflow", "level")
