"""Test which directories are reaches, and their configurations."""

import pytest

from rivid.config import merged
from rivid.errors import ConfigError, NoDataError
from rivid.fleet.layout import find_fleet
from tests.daily import write_days


@pytest.fixture
def data(tmp_path):
    for name in ("upper", "lower-2"):
        write_days(tmp_path / "data" / name, 1)
    return tmp_path / "data"


def configs(tmp_path, **texts):
    folder = tmp_path / "configs"
    folder.mkdir()
    for name, text in texts.items():
        (folder / f"{name.replace('_', '-')}.toml").write_text(text)
    return folder


def test_directories_of_logs_are_reaches_unless_the_directory_has_logs_of_its_own(data):
    (data / "notes").mkdir()
    (data / "notes" / "read.me").write_text("x")
    (data / ".hidden").mkdir()
    (data / ".hidden" / "2008-03-10.csv").write_text("x")
    assert [reach.name for reach in find_fleet(data, None)] == ["lower-2", "upper"]
    for place in ("upper", "upper/2008-03-10.csv", "nowhere"):
        assert find_fleet(data / place, None) is None
    write_days(data, 1)
    assert find_fleet(data, None) is None


@pytest.mark.parametrize("name", ["2008-03", "2008", "2008_03_10", "03", "10"])
def test_directories_of_dates_are_no_reaches(tmp_path, name):
    write_days(tmp_path / "logs" / name, 1)
    with pytest.raises(
        NoDataError, match=r"are dates, not reaches, .* `rivid ingest .*/logs/\*/\*.csv --config"
    ):
        find_fleet(tmp_path / "logs", None)
    folder = configs(tmp_path, **{name: ""} if "_" not in name else {"defaults": ""})
    if "_" not in name:  # configured as a reach
        assert [reach.name for reach in find_fleet(tmp_path / "logs", folder)] == [name]
    write_days(tmp_path / "logs" / "upper", 1)
    assert len(find_fleet(tmp_path / "logs", None)) == 2


def test_reaches_with_numbers_are_no_dates(tmp_path):
    for name in ("2001", "2002", "01", "12"):
        write_days(tmp_path / name, 30)  # from 2008-03-10 on
    assert len(find_fleet(tmp_path, None)) == 4


def test_own_keys_stand_over_shared_ones(data, tmp_path):
    folder = configs(
        tmp_path,
        defaults="[reach]\nlength = 5000\nwidth = 50\n[jmap]\nsigma_d = 5\n",
        upper="[reach]\nlength = 9000\n",
    )
    lower, upper = (reach.config() for reach in find_fleet(data, folder))
    assert (upper.reach.name, upper.reach.length, upper.reach.width) == ("upper", 9000, 50)
    assert upper.jmap.sigma_d == 5
    assert (lower.reach.name, lower.reach.length) == ("lower-2", 5000)


def test_a_file_is_shared_by_all_and_refused_once(data, tmp_path):
    path = tmp_path / "all.toml"
    path.write_text("[jmap]\nsigma_d = 9\n[run]\nestimators = ['ml']\n")
    found = [reach.config() for reach in find_fleet(data, path, ["map"])]
    assert [(c.jmap.sigma_d, c.run.estimators) for c in found] == [(9, ["map"])] * 2
    path.write_text("[jmap]\nsigma = 9\n")
    with pytest.raises(ConfigError, match="sigma"):
        find_fleet(data, path)


def test_an_invalid_name_fails_only_its_reach(data):
    names = ("a b", "é", "x" * 81, "a\nb", "fleet.html")
    for name in names:
        write_days(data / name, 1)
    found = {reach.name: reach for reach in find_fleet(data, None)}
    for name in names:
        with pytest.raises(ConfigError, match="cannot name a reach"):
            found[name].config()
    assert found["upper"].config().reach.name == "upper"


def test_a_link_that_leads_out_is_refused_and_one_that_stays_is_not(data, tmp_path):
    write_days(tmp_path / "elsewhere", 1)
    (data / "out").symlink_to(tmp_path / "elsewhere")
    (data / "again").symlink_to(data / "upper")
    found = {reach.name: reach for reach in find_fleet(data, None)}
    with pytest.raises(ConfigError, match="leads out"):
        found["out"].config()
    assert found["again"].config().reach.name == "again"


def test_a_configuration_without_directory_or_a_fleet_without_reach_has_no_data(data, tmp_path):
    folder = configs(tmp_path, upper="", middle="", defaults="")
    found = {reach.name: reach for reach in find_fleet(data, folder)}
    with pytest.raises(NoDataError, match="middle"):
        found["middle"].config()
    assert sorted(found) == ["lower-2", "middle", "upper"]
    for name in ("upper", "middle"):
        (folder / f"{name}.toml").unlink()
    (tmp_path / "empty").mkdir()
    for place in ("empty", "nowhere"):
        with pytest.raises(NoDataError):
            find_fleet(tmp_path / place, folder)


def test_a_reach_has_the_name_of_its_directory(data, tmp_path):
    folder = configs(tmp_path, upper="[reach]\nname = 'other'\n", lower_2="not toml")
    for reach, words in zip(find_fleet(data, folder), ("not valid TOML", "names the reach"), strict=True):
        with pytest.raises(ConfigError, match=words):
            reach.config()


def test_merging_changes_neither_side():
    shared, own = {"a": {"b": 1, "c": [1]}, "d": 2}, {"a": {"b": 3}, "d": {"e": 1}}
    assert merged(shared, own) == {"a": {"b": 3, "c": [1]}, "d": {"e": 1}}
    assert shared == {"a": {"b": 1, "c": [1]}, "d": 2} and own == {"a": {"b": 3}, "d": {"e": 1}}
