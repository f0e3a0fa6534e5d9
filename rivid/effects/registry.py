"""The catalogue of effects, effects that users define in files and packages, and effects from tables."""

import importlib.util
import inspect
import re
import sys
from collections.abc import Iterator, Sequence
from dataclasses import fields, replace
from functools import lru_cache
from importlib.metadata import entry_points
from itertools import chain
from pathlib import Path
from typing import Any, get_args
from zlib import crc32

from rivid.effects import flow, level, timing
from rivid.effects.base import EVENTS, FAMILIES, Effect, FoundAs, World
from rivid.errors import ConfigError
from rivid.reach.changes import Changes, together

CATALOGUE: dict[str, type[Effect]] = {
    one.name: one
    for module in (flow, timing, level)
    for one in vars(module).values()
    if isinstance(one, type) and issubclass(one, Effect)
    if not inspect.isabstract(one) and one.name
}
"""Effects of rivid, by name."""


def effect_classes(path: Path | None = None) -> dict[str, type[Effect]]:
    """All effects by name: the catalogue in its order, those of installed packages, those of a Python file.

    ConfigError where a file or package cannot be used, or a name is taken.
    """
    found = dict(CATALOGUE)
    origin = dict.fromkeys(found, "the catalogue")
    of_file = () if path is None else ((str(path), one) for one in _from_file(path))
    for where, one in chain(_from_entry_points(), of_file):
        _check_class(where, one)
        if one.name in found:
            raise ConfigError(
                f"{where}: {one.__name__}.name = {one.name!r} is taken by {origin[one.name]}: choose another"
            )
        found[one.name], origin[one.name] = one, where
    return found


def build(table: dict[str, Any], classes: dict[str, type[Effect]]) -> Effect:
    """An effect from a table: `name`, and those parameters that are not the usual ones.

    ConfigError names the effect and the key.
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
    """Changes of several effects together; those of the inflow are applied in this order.

    RividError where changes cannot be joined; see :func:`rivid.reach.changes.together`.
    """
    return together(changes for _, changes in _in_turn(effects, world))


def _in_turn(effects: Sequence[Effect], world: World) -> Iterator[tuple[World, Changes]]:
    inflow, count = world.inflow, dict[str, int]()
    for effect in effects:
        count[effect.name] = count.get(effect.name, 0) + 1
        seed = (*world.seed, crc32(effect.name.encode()), count[effect.name])
        seen = replace(world, inflow=inflow, seed=seed)
        changes = effect.changes(seen)
        if changes.inflow is not None:
            inflow = changes.inflow
        yield seen, changes


def _from_entry_points() -> Iterator[tuple[str, type[Effect]]]:
    """Origin and class of each effect of an installed package: its entry points of this group."""
    for point in sorted(entry_points(group="rivid.effects"), key=lambda p: (p.name, p.value)):
        where = f"entry point {point.name} = {point.value}"
        try:
            one = point.load()
        except (Exception, SystemExit) as error:  # noqa: BLE001 - a package may raise anything
            raise ConfigError(
                f"{where} does not load: {_reason(error)}: repair or remove the package"
            ) from None
        if not (isinstance(one, type) and issubclass(one, Effect)):
            raise ConfigError(f"{where} is {one!r}: expected a subclass of rivid.effects.Effect")
        yield where, one


def _from_file(path: Path) -> tuple[type[Effect], ...]:
    """The effects that a Python file defines, in its order."""
    try:
        known = path.stat()
    except OSError as error:
        raise ConfigError(f"effects file {path}: {error.strerror}: expected a Python file") from None
    if not path.is_file():
        raise ConfigError(f"effects file {path} is no file: expected a Python file")
    return _import_file(path.resolve(), known.st_mtime_ns, known.st_size)


@lru_cache
def _import_file(path: Path, changed: int, size: int) -> tuple[type[Effect], ...]:
    """Import a file once while it is unchanged, so that its classes stay the same objects."""
    module = f"rivid_effects_file_{crc32(str(path).encode()):08x}_{changed:x}_{size:x}"
    spec = importlib.util.spec_from_file_location(module, path)
    if spec is None or spec.loader is None:
        raise ConfigError(f"effects file {path}: expected a Python file, its name ending in .py")
    loaded = importlib.util.module_from_spec(spec)
    sys.modules[module] = loaded  # dataclasses look their module up
    try:
        spec.loader.exec_module(loaded)
    except (Exception, SystemExit) as error:  # noqa: BLE001 - a file may raise anything
        del sys.modules[module]
        raise ConfigError(f"effects file {path} does not import: {_reason(error)}: repair it") from None
    defined = [
        one
        for one in vars(loaded).values()
        if isinstance(one, type) and issubclass(one, Effect) and one.__module__ == module
    ]
    effects = tuple(dict.fromkeys(one for one in defined if not inspect.isabstract(one)))
    if not effects:
        lack = "; ".join(f"{one.__name__} lacks {', '.join(one.__abstractmethods__)}" for one in defined)
        raise ConfigError(
            f"effects file {path} defines no effect{f' ({lack})' if lack else ''}: expected a subclass of "
            "rivid.effects.Effect with a method `changes`"
        )
    return effects


def _check_class(where: str, one: type[Effect]) -> None:
    """Raise ConfigError where the class of an effect is incomplete."""
    here = f"{where}: {one.__name__}"
    name: Any = getattr(one, "name", None)
    if not isinstance(name, str) or not re.fullmatch("[a-z][a-z0-9_]*", name):
        raise ConfigError(f"{here}.name is {name!r}: expected words in small letters, as 'fish_ladder'")
    if (came := getattr(one, "family", None)) not in FAMILIES:
        raise ConfigError(f"{here}.family is {came!r}: expected one of {', '.join(FAMILIES)}")
    for key in ("sentence", "looks"):
        text: Any = getattr(one, key, None)
        if not isinstance(text, str) or not text.strip():
            raise ConfigError(f"{here}.{key} is {text!r}: expected a sentence")
    if one.found_as not in get_args(FoundAs):
        raise ConfigError(f"{here}.found_as is {one.found_as!r}: expected one of {get_args(FoundAs)}")
    if one.found_as in EVENTS and "from_events" not in vars(one):
        raise ConfigError(f"{here} is found as events: expected a class method from_events")
    if "__dataclass_fields__" not in vars(one):
        raise ConfigError(f"{here} is no dataclass: put @dataclass(frozen=True, kw_only=True) before it")
    for part in fields(one):
        if part.name not in ("dates", "hours") and "quantity" not in part.metadata:
            raise ConfigError(
                f"{here}.{part.name} has no unit and limits: expected {part.name}: float = quantity(...)"
            )
    try:
        one()
    except ConfigError as error:
        raise ConfigError(f"{here} refuses its own defaults: {error}") from None


def _reason(error: BaseException) -> str:
    line = getattr(error, "lineno", None)
    text = " ".join(str(getattr(error, "msg", None) or error).split())
    return f"{type(error).__name__}{f': {text}' if text else ''}{f' (line {line})' if line else ''}"
