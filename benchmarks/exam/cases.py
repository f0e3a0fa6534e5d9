"""What is asked: the cases of the exam, their sizes, and how many seeds of each.

A case is a scenario file, with its effects at a size; a row of the page is made of the cases that share its
name. Seeds from :data:`FIRST_SEED` on were not looked at while the workflow was built.
"""

import tomllib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parent.parent.parent
SIZES_FILE = ROOT / "benchmarks" / "exam" / "sizes.toml"
FIRST_SEED = 5000

ALLOWED = frozenset({"wave_attenuation", "flow_dependent_delay"})
"""What a plain response may truly lack of an uneven reach: not counted against it."""
NOTHING: frozenset[str] = frozenset()

SIZE_OF: dict[str, tuple[str, ...]] = {
    "lateral_inflow": ("inflow",), "diurnal_inflow": ("amplitude",), "rain_inflow": ("peak",),
    "unlogged_upstream_release": ("size",), "unlogged_downstream_release": ("size",),
    "leakage": ("loss",), "inflow_gain_error": ("error",), "outflow_gain_error": ("error",),
    "gate_head_effect": ("gain",), "storage_area_slope": ("slope",), "side_storage": ("area", "exchange"),
    "flow_dependent_delay": ("delay",), "wave_attenuation": ("spread",), "outflow_lag": ("lag",),
    "clock_offset": ("offset",), "gate_deadband": ("band",), "gate_rate_limit": ("rate",),
    "sensor_drift": ("drift",), "sensor_step": ("step",), "wind_setup": ("deviation",),
    "seiche": ("amplitude",),
}  # fmt: skip
"""The parameters that make each effect larger, all by the same factor; the first one is its size."""
INVERSE = frozenset({"gate_rate_limit"})
"""Effects that are the larger, the smaller their parameter."""

TWINS: dict[str, tuple[str, ...]] = {
    "inflow_gain_error": ("outflow_gain_error",),
    "outflow_gain_error": ("inflow_gain_error",),
    "sensor_drift": ("lateral_inflow",),
}
"""Effects that logs alone do not tell from another one: both are expected, and what would tell them apart."""


def resized(table: dict[str, Any], factor: float) -> dict[str, Any]:
    """An effect's table, its effect `factor` times as large.

    Examples
    --------
    >>> resized({"name": "side_storage", "area": 1e5, "exchange": 30.0}, 2.0)["exchange"]
    60.0
    >>> resized({"name": "gate_rate_limit", "rate": 0.02}, 2.0)["rate"]
    0.01
    """
    name = table["name"]
    factor = 1.0 / factor if name in INVERSE else factor
    larger = dict(table)
    for key in SIZE_OF[name]:
        value = table[key]
        larger[key] = [factor * v for v in value] if isinstance(value, list | tuple) else factor * value
    return larger


def sizes() -> dict[str, float]:
    """What 80 % power needs of each effect, in the unit of its size; see `benchmarks.exam.power`."""
    found: dict[str, float] = tomllib.loads(SIZES_FILE.read_text(encoding="utf-8"))["sizes"]
    return found


@dataclass(frozen=True)
class Case:
    """A season to diagnose, and what is expected of the answer.

    Attributes
    ----------
    name : str
        Its own.
    row : str
        Key of its row; see `benchmarks.exam.judging`.
    scenario : str
        Under configs/scenarios, without suffix.
    seeds : int
        How many of them are asked.
    expected : tuple of str
        Names to be given: one, both of a pair, or those of a group.
    times : float, optional
        Size in units of what 80 % power needs; as the file has it where None.
    without : tuple of str
        Effects that the diagnosis does not know.
    then : str, optional
        Scenario of the second half of the season: the same river, other people.
    allowed : frozenset of str
        Names that are not counted against the answer.
    river : bool
        Whether it is a free river, made by `benchmarks.exam.river`.
    """

    name: str
    row: str
    scenario: str
    seeds: int
    expected: tuple[str, ...] = ()
    times: float | None = None
    without: tuple[str, ...] = ()
    then: str | None = None
    allowed: frozenset[str] = ALLOWED
    river: bool = False

    def sized(self, table: dict[str, Any]) -> dict[str, Any]:
        """A planted effect's table at the case's size."""
        if self.times is None:
            return table
        value = table[SIZE_OF[table["name"]][0]]
        value = max(value) if isinstance(value, list | tuple) else value
        wanted = sizes()[table["name"]]
        if table["name"] in INVERSE:
            return resized(table, self.times * value / wanted)
        return resized(table, self.times * wanted / value)


def cases() -> tuple[Case, ...]:
    """All of them, by row."""
    return (*_nothing(), *_one(), *_groups(), *_unknown(), *_several(), *_windows(), *_not_held(), *_river())


def _nothing() -> Iterator[Case]:
    yield Case("nothing/linear", "nothing_linear", "exam/linear", 400, allowed=NOTHING)
    yield Case("nothing/uneven", "nothing_hydraulic", "uneven", 120)
    yield Case("people/linear", "people", "exam/linear", 60, then="exam/other_people_linear", allowed=NOTHING)
    yield Case("people/uneven", "people", "uneven", 60, then="exam/other_people")


def _one() -> Iterator[Case]:
    """Each effect at each size; those with a twin in the catalogue are asked as a group."""
    for name in SIZE_OF:
        twins = TWINS.get(name, ())
        for times, seeds in ((None, 5), (1.0, 5), (2.0, 5), (4.0, 4)):
            size = "planted" if times is None else f"x{times:g}"
            row = "group" if twins else {None: "one_planted", 1.0: "one_x1"}.get(times, "one_x2")
            if twins and times == 1.0:
                row = "group_x1"
            yield Case(f"one/{name}/{size}", row, f"effects/{name}", seeds, (name, *twins), times)


def _groups() -> Iterator[Case]:
    gains = ("inflow_gain_error", "outflow_gain_error")
    yield Case("pairs/gains", "group", "pairs/gains", 10, gains)
    yield Case(
        "pairs/constant_and_drift", "group", "pairs/constant_and_drift", 10,
        ("lateral_inflow", "sensor_drift"),
    )  # fmt: skip
    yield Case("pairs/leak_and_head", "group", "pairs/leak_and_head", 10, ("leakage", "gate_head_effect"))


def _unknown() -> Iterator[Case]:
    for outside in ("hunting", "rating", "siphon"):
        yield Case(f"outside/{outside}", "unknown", f"outside/{outside}", 10)
    for name in ("seiche", "unlogged_downstream_release", "clock_offset", "diurnal_inflow"):
        yield Case(f"without/{name}", "unknown", f"effects/{name}", 8, without=(name,))


def _several() -> Iterator[Case]:
    for name, both in (
        ("day_and_bypass", ("diurnal_inflow", "unlogged_upstream_release")),
        ("lag_and_clock", ("outflow_lag", "clock_offset")),
        ("rain_and_lock", ("rain_inflow", "unlogged_downstream_release")),
    ):
        yield Case(f"pairs/{name}", "two", f"pairs/{name}", 12, both)


def _windows() -> Iterator[Case]:
    for name, effect in (
        ("one_season", "diurnal_inflow"), ("one_shift", "outflow_gain_error"), ("from_a_date", "lateral_inflow"),
    ):  # fmt: skip
        yield Case(f"windows/{name}", "window", f"windows/{name}", 12, (effect,))


def _not_held() -> Iterator[Case]:
    yield Case("not_held/fitted_days", "fitted_days", "exam/fitted_days", 20)
    yield Case("not_held/open_days", "open_days", "exam/open_days", 20)


def _river() -> Iterator[Case]:
    yield Case("river/nothing", "river_nothing", "exam/river", 20, allowed=NOTHING, river=True)
    yield Case(
        "river/bypass", "river_bypass", "exam/river_bypass", 20, ("unlogged_upstream_release",), river=True,
        allowed=NOTHING,
    )  # fmt: skip


QUICK = (
    "nothing/linear", "nothing/uneven", "people/linear", "one/diurnal_inflow/planted",
    "one/clock_offset/x4", "one/unlogged_upstream_release/x2", "pairs/gains", "outside/hunting",
    "pairs/day_and_bypass", "windows/from_a_date", "not_held/open_days", "river/bypass",
)  # fmt: skip
"""One seed of each of these in `--quick`."""

Task = tuple[Case, int]


def tasks(only: Sequence[str] = (), *, quick: bool = False, share: float = 1.0) -> list[Task]:
    """Cases with their seeds, in an order that leaves every row in proportion wherever it is stopped.

    Parameters
    ----------
    only : sequence of str
        Parts of names; all cases without.
    quick : bool
        One seed of a few.
    share : float
        Of the seeds, rounded up.
    """
    found: list[tuple[float, int, Task]] = []
    for place, case in enumerate(cases()):
        if only and not any(part in case.name or part == case.row for part in only):
            continue
        if quick and case.name not in QUICK:
            continue
        count = 1 if quick else max(round(case.seeds * share), 1)
        found += [((k + 0.5) / count, place, (case, FIRST_SEED + k)) for k in range(count)]
    return [task for _, _, task in sorted(found, key=lambda one: one[:2])]
