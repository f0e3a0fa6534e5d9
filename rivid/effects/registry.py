"""The catalogue of effects, effects of users, and effects from tables."""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any
from zlib import crc32

from rivid.effects import flow, level, timing
from rivid.effects.base import Effect, World
from rivid.effects.users import check_class, from_entry_points, from_file
from rivid.errors import ConfigError
from rivid.reach.changes import Changes, together

CATALOGUE: dict[str, type[Effect]] = {
    one.name: one
    for one in (
        flow.LateralInflow,
        flow.DiurnalInflow,
        flow.RainInflow,
        flow.UnloggedUpstreamRelease,
        flow.UnloggedDownstreamRelease,
        flow.Leakage,
        flow.InflowGainError,
        flow.OutflowGainError,
        flow.GateHeadEffect,
        flow.StorageAreaSlope,
        flow.SideStorage,
        timing.FlowDependentDelay,
        timing.WaveAttenuation,
        timing.OutflowLag,
        timing.ClockOffset,
        timing.GateDeadband,
        timing.GateRateLimit,
        level.SensorDrift,
        level.SensorStep,
        level.WindSetup,
        level.Seiche,
    )
}
"""Effects of rivid, by name."""


def effect_classes(path: Path | None = None) -> dict[str, type[Effect]]:
    """All effects by name: the catalogue, those of installed packages, those of a file.

    Parameters
    ----------
    path : Path, optional
        A Python file; each subclass of :class:`Effect` that it defines is taken.

    Returns
    -------
    dict
        The catalogue first, in its order.

    Raises
    ------
    ConfigError
        Where a file or package cannot be used, or a name is taken.
    """
    found = dict(CATALOGUE)
    home = dict.fromkeys(found, "the catalogue")
    sources: list[tuple[str, type[Effect]]] = from_entry_points()
    if path is not None:
        sources += [(str(path), one) for one in from_file(path)]
    for where, one in sources:
        check_class(where, one)
        if one.name in found:
            raise ConfigError(
                f"{where}: {one.__name__}.name = {one.name!r} is taken by {home[one.name]}: choose another"
            )
        found[one.name], home[one.name] = one, where
    return found


def build(table: dict[str, Any], classes: dict[str, type[Effect]]) -> Effect:
    """An effect from a table of a configuration.

    Parameters
    ----------
    table : dict
        `name`, and those parameters that are not the usual ones.
    classes : dict
        From :func:`effect_classes`.

    Raises
    ------
    ConfigError
        Naming the effect and the key.
    """
    name = table.get("name")
    if not isinstance(name, str) or name not in classes:
        came = "an effect without a name" if name is None else f"no effect is called {name!r}"
        raise ConfigError(f"{came}: expected name = one of {', '.join(classes)}")
    return classes[name].from_table(table)


def worlds_of(effects: Sequence[Effect], world: World) -> tuple[World, ...]:
    """Input of each effect: the real inflow after the effects before it, and its seed.

    The seed depends on the name and the count of effects of that name, so other effects change no draw.
    """
    return tuple(seen for seen, _ in _in_turn(effects, world))


def changes_of(effects: Sequence[Effect], world: World) -> Changes:
    """Changes of several effects together.

    Parameters
    ----------
    effects : sequence of Effect
        Changes of the inflow are applied in this order.
    world : World

    Raises
    ------
    RividError
        Where changes cannot be joined; see :func:`rivid.reach.changes.together`.
    """
    parts = [changes for _, changes in _in_turn(effects, world)]
    inflows = [part.inflow for part in parts if part.inflow is not None]
    joined = together(replace(part, inflow=None) for part in parts)
    return replace(joined, inflow=inflows[-1] if inflows else None)


def _in_turn(effects: Iterable[Effect], world: World) -> list[tuple[World, Changes]]:
    steps = []
    inflow, count = world.inflow, dict[str, int]()
    for effect in effects:
        count[effect.name] = count.get(effect.name, 0) + 1
        seed = (*world.seed, crc32(effect.name.encode()), count[effect.name])
        seen = replace(world, inflow=inflow, seed=seed)
        changes = effect.changes(seen)
        if changes.inflow is not None:
            inflow = changes.inflow
        steps.append((seen, changes))
    return steps
