"""Effects that users define: in a Python file, or in an installed package."""

import importlib.util
import inspect
import re
import sys
from dataclasses import fields
from functools import lru_cache
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any, get_args
from zlib import crc32

from rivid.effects.base import FAMILIES, Effect, FoundAs
from rivid.errors import ConfigError

GROUP = "rivid.effects"
"""Entry points of this group are effects, each a subclass of :class:`Effect`."""


def from_entry_points() -> list[tuple[str, type[Effect]]]:
    """Origin and class of each effect of an installed package.

    Raises
    ------
    ConfigError
        Where one does not load, or is no effect.
    """
    found = []
    for point in sorted(entry_points(group=GROUP), key=lambda p: (p.name, p.value)):
        where = f"entry point {point.name} = {point.value}"
        try:
            one = point.load()
        except (Exception, SystemExit) as error:  # noqa: BLE001 - a package may raise anything
            raise ConfigError(
                f"{where} does not load: {_said(error)}: repair or remove the package"
            ) from None
        if not (isinstance(one, type) and issubclass(one, Effect)):
            raise ConfigError(f"{where} is {one!r}: expected a subclass of rivid.effects.Effect")
        found.append((where, one))
    return found


def from_file(path: Path) -> tuple[type[Effect], ...]:
    """The effects that a Python file defines, in its order.

    Raises
    ------
    ConfigError
        Where there is no such file, it does not import, or it defines none.
    """
    try:
        known = path.stat()
    except OSError as error:
        raise ConfigError(f"effects file {path}: {error.strerror}: expected a Python file") from None
    if not path.is_file():
        raise ConfigError(f"effects file {path} is no file: expected a Python file")
    return _from_file(path.resolve(), known.st_mtime_ns, known.st_size)


@lru_cache
def _from_file(path: Path, changed: int, size: int) -> tuple[type[Effect], ...]:
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
        raise ConfigError(f"effects file {path} does not import: {_said(error)}: repair it") from None
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


def check_class(where: str, one: type[Effect]) -> None:
    """Check that the class of an effect is complete.

    Raises
    ------
    ConfigError
        Naming the place, the class and what is missing.
    """
    here = f"{where}: {one.__name__}"
    name: Any = getattr(one, "name", None)
    if not isinstance(name, str) or not re.fullmatch("[a-z][a-z0-9_]*", name):
        raise ConfigError(f"{here}.name is {name!r}: expected words in small letters, as 'fish_ladder'")
    if getattr(one, "family", None) not in FAMILIES:
        came = getattr(one, "family", None)
        raise ConfigError(f"{here}.family is {came!r}: expected one of {', '.join(FAMILIES)}")
    for key in ("sentence", "looks"):
        said: Any = getattr(one, key, None)
        if not isinstance(said, str) or not said.strip():
            raise ConfigError(f"{here}.{key} is {said!r}: expected a sentence for people")
    if one.found_as not in get_args(FoundAs):
        raise ConfigError(f"{here}.found_as is {one.found_as!r}: expected one of {get_args(FoundAs)}")
    if one.found_as in ("recession", "pulse") and "from_events" not in vars(one):
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


def _said(error: BaseException) -> str:
    line = getattr(error, "lineno", None)
    text = " ".join(str(getattr(error, "msg", None) or error).split())
    return f"{type(error).__name__}{f': {text}' if text else ''}{f' (line {line})' if line else ''}"
