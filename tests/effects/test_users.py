import os
from dataclasses import replace

import numpy as np
import pytest

import rivid
from rivid.cli import cli
from rivid.config import load_config
from rivid.diagnosis.answer import breaker
from rivid.diagnosis.search import Library
from rivid.effects import CATALOGUE, build, effect_classes
from rivid.errors import ConfigError
from tests.diagnosis import pools
from tests.effects.worlds import world

LADDER = """
from dataclasses import dataclass
from rivid.effects import Effect, World, quantity
from rivid.reach.changes import AddedFlow, Changes


@dataclass(frozen=True, kw_only=True)
class FishLadder(Effect):
    name = "fish_ladder"
    family = "flow"
    sentence = "A ladder for fish takes water past the dam."
    looks = "A constant loss."
    acts_on_river = False
    confounded_with = {"leakage": "Close the ladder for a day."}

    flow: float = quantity(0.8, "m3/s", 0.0, 10.0, "what the ladder takes")

    def changes(self, world: World) -> Changes:
        return Changes(added=(AddedFlow(1.0, -self.flow * self.active(world)),))
"""


@pytest.fixture
def write(tmp_path):
    def write(text, name="mine.py"):
        path = tmp_path / name
        path.write_text(text, encoding="utf-8")
        return path

    return write


def test_an_effect_of_a_file_stands_behind_the_catalogue_and_works(write):
    classes = effect_classes(write(LADDER))
    assert list(classes) == [*CATALOGUE, "fish_ladder"]
    one = build({"name": "fish_ladder", "flow": 2, "hours": [0, 12]}, classes)
    here = world(days=1)
    assert one.changes(here).added[0].flow.tolist() == np.where(here.hour < 12, -2.0, 0.0).tolist()
    with pytest.raises(ConfigError, match=r"fish_ladder: flow = 11: expected a number from 0 to 10 \[m3/s\]"):
        build({"name": "fish_ladder", "flow": 11}, classes)


@pytest.mark.long
def test_one_class_in_one_file_is_listed_simulated_and_a_candidate_of_the_diagnosis(write, tmp_path, capsys):
    path = write(LADDER)
    assert cli.main(["effects", "--effects-file", str(path)], standalone_mode=False) == 0
    assert "fish_ladder" in capsys.readouterr().out

    short, planted = {"days": 3, "missing_days": 0}, {"name": "fish_ladder", "flow": 2.0}
    bare = rivid.simulate(**short)
    season = rivid.simulate(**short, effects_file=str(path), effects=[planted])
    np.testing.assert_allclose((season.unlogged - season.weather), -2.0)
    assert season.level.mean() < bare.level.mean()

    config = tmp_path / "reach.toml"
    config.write_text('[diagnose]\neffects_file = "mine.py"\n')
    classes = effect_classes(load_config(config).diagnose.effects_file)
    record = pools.season(3, days=4, effects=(build({**planted, "flow": 6.0}, classes),))
    ladder = {"fish_ladder": classes["fish_ladder"]}
    library = Library.of(pools.model_of(record), record, ladder)
    ((trial, columns),) = library.trials
    assert trial.name == "fish_ladder"
    assert (columns[0, :, -1] < -0.01).all()
    assert Library.of(pools.model_of(record), replace(record, kind="river"), ladder).trials == ()
    assert breaker(classes["leakage"], (classes["fish_ladder"],)) == "Close the ladder for a day."


def test_a_file_is_imported_once_and_again_when_it_changes(write):
    path = write(LADDER)
    first = effect_classes(path)["fish_ladder"]
    assert effect_classes(path)["fish_ladder"] is first
    write(LADDER.replace("0.8", "0.9"))
    os.utime(path, ns=(1, 1))
    assert effect_classes(path)["fish_ladder"]().flow == 0.9


def test_helpers_and_what_a_file_imports_are_no_effects_of_it(write):
    text = LADDER + (
        "\nfrom rivid.effects.flow import Leakage\n"
        "\n\nclass Base(Effect):\n    pass\n\n\nAlias = FishLadder\n"
    )
    assert list(effect_classes(write(text))) == [*CATALOGUE, "fish_ladder"]


@pytest.mark.parametrize(
    "text,reason",
    [
        ("x = (", r"does not import: SyntaxError: .* \(line 1\): repair it"),
        ("import no_such_module_at_all", "does not import: ModuleNotFoundError: No module named"),
        ("raise SystemExit('out')", "does not import: SystemExit: out"),
        ("raise RuntimeError('two\\nlines')", "does not import: RuntimeError: two lines"),
        ("x = 1", "defines no effect: expected a subclass"),
        (LADDER.replace("def changes", "def change"), r"defines no effect \(FishLadder lacks changes\)"),
        (LADDER.replace("fish_ladder", "leakage"), "FishLadder.name = 'leakage' is taken by the catalogue"),
        (LADDER + LADDER.replace("FishLadder", "Ladder"), "Ladder.name = 'fish_ladder' is taken by"),
        (LADDER.replace("fish_ladder", "Fish ladder"), "FishLadder.name is 'Fish ladder': expected"),
        (LADDER.replace('    name = "fish_ladder"\n', ""), "FishLadder.name is None: expected"),
        (LADDER.replace('"flow"\n', '"fish"\n'), "family is 'fish': expected one of flow, timing, level"),
        (LADDER.replace('    looks = "A constant loss."\n', ""), "FishLadder.looks is None: expected"),
        (LADDER.replace("@dataclass(frozen=True, kw_only=True)\n", ""), "FishLadder is no dataclass: put"),
        (LADDER.replace("acts_on_river = False", "found_as = 'wave'"), "found_as is 'wave': expected one"),
        (LADDER.replace("acts_on_river = False", "found_as = 'pulse'"), "expected a class method from_even"),
        (LADDER.replace("quantity(0.8,", "quantity(80,"), "refuses its own defaults: fish_ladder: flow = 80"),
        (
            LADDER.replace('quantity(0.8, "m3/s", 0.0, 10.0, "what the ladder takes")', "0.8"),
            r"FishLadder.flow has no unit and limits: expected flow: float = quantity\(...\)",
        ),
    ],
)  # fmt: skip
def test_a_file_that_cannot_be_used_is_refused_in_one_line(write, text, reason):
    path = write(text)
    with pytest.raises(ConfigError, match=reason) as caught:
        effect_classes(path)
    assert str(path) in str(caught.value) and "\n" not in str(caught.value)


def test_a_missing_file_a_directory_and_another_kind_of_file_are_refused(tmp_path, write):
    for path, reason in (
        (tmp_path / "none.py", "No such file"),
        (tmp_path, "is no file"),
        (write(LADDER, "mine.txt"), r"ending in \.py"),
    ):
        with pytest.raises(ConfigError, match=reason):
            effect_classes(path)


@pytest.fixture
def install(tmp_path, monkeypatch):
    """Install a package that offers effects."""

    def install(points, text=LADDER):
        (tmp_path / "ladder_package.py").write_text(text, encoding="utf-8")
        info = tmp_path / "ladder_package-1.0.dist-info"
        info.mkdir()
        (info / "METADATA").write_text("Metadata-Version: 2.1\nName: ladder-package\nVersion: 1.0\n")
        (info / "entry_points.txt").write_text(f"[rivid.effects]\n{points}\n")
        monkeypatch.delitem(__import__("sys").modules, "ladder_package", raising=False)
        monkeypatch.syspath_prepend(tmp_path)

    yield install
    __import__("sys").modules.pop("ladder_package", None)


def test_effects_of_installed_packages_are_found_by_their_entry_points(install, write):
    install("fish_ladder = ladder_package:FishLadder")
    classes = effect_classes()
    assert list(classes) == [*CATALOGUE, "fish_ladder"]
    assert build({"name": "fish_ladder"}, classes).flow == 0.8
    with pytest.raises(ConfigError, match="is taken by entry point fish_ladder = ladder_package:FishLadder"):
        effect_classes(write(LADDER))


@pytest.mark.parametrize(
    "point,reason",
    [
        ("fish = ladder_package:Fish", "fish = ladder_package:Fish does not load: AttributeError"),
        ("fish = ladder_package:dataclass", "expected a subclass of rivid.effects.Effect"),
    ],
)
def test_a_broken_entry_point_is_named(install, point, reason):
    install(point)
    with pytest.raises(ConfigError, match=reason):
        effect_classes()
