"""Test properties of every effect of the catalogue: tables, limits, windows."""

import datetime as dt
import json
import tomllib
from dataclasses import fields, replace

import numpy as np
import pytest

from rivid.effects import CATALOGUE, FAMILIES, build, effect_classes
from rivid.errors import ConfigError
from tests.effects.worlds import FIRST, world

DATES = (FIRST + dt.timedelta(days=1), FIRST + dt.timedelta(days=3))
HOURS = (21.5, 5.0)
WINDOWED = [name for name, one in CATALOGUE.items() if one.windowed]
EVENTS = {"rain_inflow", "unlogged_downstream_release"}


@pytest.fixture(params=CATALOGUE)
def effect(request):
    """Return each effect, with its own values."""
    one = CATALOGUE[request.param]
    values = {}
    for key, spec in one.parameters().items():
        usual = one.defaults()[key]
        if usual == ():
            values[key] = (3.5, 27.25)
        else:
            values[key] = min(usual * 1.25 + 0.001, spec.high)
    window = {"dates": DATES, "hours": HOURS} if one.windowed else {}
    return one(**values, **window)


def touched(changes, here):
    """Return where a change acts, with the shape of the time grid; one value holds for all samples."""
    gate = changes.gate
    parts = [gate.dead_band != 0, np.isfinite(gate.rate), gate.lag != 0, gate.factor != 1, gate.head != 0]
    parts += [a.flow != 0 for a in changes.added] + [a.loss != 0 for a in changes.leaks]
    parts += [a.exchange != 0 for a in changes.ponds] + [changes.gauge != 0, changes.rating != 0]
    parts += [changes.well != 0]
    if changes.inflow is not None:
        parts.append(changes.inflow != here.inflow)
    if changes.area_slope:
        parts.append(np.ones(1, bool))
    return np.any([np.broadcast_to(p, here.time.shape) for p in parts], axis=0)


def test_the_catalogue_has_all_names_in_the_order_of_the_table():
    assert list(CATALOGUE) == [
        "lateral_inflow", "diurnal_inflow", "rain_inflow", "unlogged_upstream_release",
        "unlogged_downstream_release", "leakage", "inflow_gain_error", "outflow_gain_error",
        "gate_head_effect", "storage_area_slope", "side_storage", "flow_dependent_delay",
        "wave_attenuation", "outflow_lag", "clock_offset", "ice_cover", "gate_deadband", "gate_rate_limit",
        "sensor_drift", "sensor_step", "rating_shift", "stilling_well", "tide", "wind_setup",
        "seiche",
    ]  # fmt: skip


@pytest.mark.parametrize("name", CATALOGUE)
def test_an_effect_has_its_attributes_and_parameters(name):
    one = CATALOGUE[name]
    assert one.name == name and one.family in FAMILIES
    assert one.sentence.endswith(".") and one.looks.endswith(".")
    assert one.parameters()
    for key, spec in one.parameters().items():
        assert np.isfinite([spec.low, spec.high]).all() and spec.low < spec.high, key
        assert spec.unit and spec.meaning
    assert set(one.defaults()) == set(one.parameters())
    assert {f.name for f in fields(one)} == {*one.parameters(), "dates", "hours"}


def test_a_table_gives_the_effect_again(effect):
    table = effect.to_table()
    assert build(table, CATALOGUE) == effect
    assert build(json.loads(json.dumps(table, default=str)), CATALOGUE) == effect
    assert build({"name": effect.name}, CATALOGUE) == type(effect)()


def test_values_up_to_the_limits_are_allowed_and_others_are_refused(effect):
    for key, spec in effect.parameters().items():
        listed = spec.many and effect.defaults()[key] == ()
        for value in (spec.low, spec.high):
            one = build(effect.to_table() | {key: [value] if listed else value}, CATALOGUE)
            assert np.ravel(getattr(one, key)).tolist() == [value]
        for bad in (spec.low - 1.0, spec.high * 2.0 + 1.0, float("nan"), True, "much"):
            with pytest.raises(ConfigError) as caught:
                build(effect.to_table() | {key: [bad] if listed else bad}, CATALOGUE)
            message = str(caught.value)
            assert message.startswith(f"{effect.name}: {key}") and "\n" not in message
            assert f"{spec.low:g} to {spec.high:g} [{spec.unit}]" in message
        if not spec.many:
            with pytest.raises(ConfigError, match=f"^{effect.name}: {key} = .*expected one number"):
                build(effect.to_table() | {key: [spec.low, spec.high]}, CATALOGUE)
    with pytest.raises(ConfigError, match="unknown key 'colour'") as caught:
        build(effect.to_table() | {"colour": 3}, CATALOGUE)
    assert all(key in str(caught.value) for key in effect.parameters())


@pytest.mark.parametrize(
    "key,bad,expected",
    [
        ("dates", ["2008-03-29"], "expected [first, last]"),
        ("dates", ["2008-03-29", "soon"], "expected [first, last]"),
        ("dates", [dt.datetime(2008, 3, 29), dt.date(2008, 3, 30)], "expected [first, last]"),
        ("dates", ["2008-03-29", "2008-03-28"], "the first before the last"),
        ("hours", [3], "expected [from, to]"),
        ("hours", [3, 25], "0 to 24"),
        ("hours", [6, 6], "two different hours"),
        ("hours", [24, 0], "two different hours"),
        ("hours", "3-6", "expected [from, to]"),
    ],
)
def test_impossible_windows_are_refused(key, bad, expected):
    for name in WINDOWED:
        with pytest.raises(ConfigError) as caught:
            build({"name": name, key: bad}, CATALOGUE)
        assert str(caught.value).startswith(f"{name}: {key}") and expected in str(caught.value)


@pytest.mark.parametrize("rows", [False, True])
def test_an_effect_is_only_where_its_dates_and_hours_allow(effect, rows):
    here = world(3, days=6, rows=rows)
    before = here.inflow.copy(), here.time.copy()
    where = touched(effect.changes(here), here)
    assert where.any() and (here.inflow == before[0]).all() and (here.time == before[1]).all()
    assert (replace(effect, dates=None, hours=None).active(here) == 1.0).all()
    if not effect.windowed:
        return
    assert (replace(effect, dates=None, hours=(0, 24)).active(here) == 1.0).all()
    hour = here.time / 3600 % 24
    there = (here.time >= 86_400) & (here.time < 4 * 86_400) & ((hour >= 21.5) | (hour < 5.0))
    if effect.name in EVENTS:  # the starts are limited: to that of 27.25 h, not that of 3.5 h
        assert [e["start_h"] for e in effect.events(here)] == [27.25]
        assert not where[here.time < 27.25 * 3600 - 133].any()
    else:
        assert not where[~there].any()


def test_a_table_from_toml_may_hold_dates_and_whole_numbers():
    table = tomllib.loads(
        'name = "lateral_inflow"\ninflow = [1, 2]\ndates = [2008-03-28, "2008-03-30"]\nhours = [22, 6]\n'
    )
    one = build(table, effect_classes())
    assert one.inflow == (1, 2)
    assert one.dates == (dt.date(2008, 3, 28), dt.date(2008, 3, 30)) and one.hours == (22, 6)


@pytest.mark.parametrize("table", [{}, {"name": "lateral"}, {"name": 3}])
def test_an_unknown_effect_lists_the_valid_names(table):
    with pytest.raises(ConfigError) as caught:
        build(table, CATALOGUE)
    assert all(name in str(caught.value) for name in CATALOGUE)
