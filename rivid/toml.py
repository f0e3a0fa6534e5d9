"""Read TOML into a model; an error is one line: the file, the key, what came and what is valid."""

import tomllib
from collections.abc import Iterable
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from rivid.errors import ConfigError

T = TypeVar("T", bound=BaseModel)
MOST_BYTES = 1_000_000
"""Largest configuration file [bytes]; larger ones are not read."""
MOST_DEPTH = 20
"""Deepest nesting of tables and lists."""


def load_toml(path: Path, model: type[T]) -> T:
    """Read a TOML file into a model.

    Raises
    ------
    ConfigError
        In one line: the file, the key, what came and what is valid.
    """
    return parse(read_toml(path), model, str(path))


def read_toml(path: Path) -> dict[str, Any]:
    """Read a TOML file.

    Raises
    ------
    ConfigError
        In one line, where it cannot be read or is not TOML.
    """
    try:
        with open(path, "rb") as file:
            content = file.read(MOST_BYTES + 1)  # a device never ends
        if len(content) > MOST_BYTES:
            raise ConfigError(f"{path} is too large for a configuration (limit {MOST_BYTES:,} bytes)")
        raw = tomllib.loads(content.decode("utf-8-sig"))
    except OSError as error:
        raise ConfigError(f"cannot read {path}: {error.strerror}: expected a TOML file") from None
    except (ValueError, RecursionError) as error:  # of TOML, of UTF-8, of a number of thousands of digits
        raise ConfigError(f"{path} is not valid TOML: {error}") from None
    _refuse_depth(raw, path)
    return raw


def _refuse_depth(raw: dict[str, Any], path: Path) -> None:
    """Refuse nesting that would exhaust the stack; a valid configuration has a few levels."""
    level: list[Any] = [raw]
    for _ in range(MOST_DEPTH):
        level = [
            inner
            for value in level
            for inner in (value.values() if isinstance(value, dict) else value)
            if isinstance(inner, (dict, list))
        ]
        if not level:
            return
    raise ConfigError(f"{path}: tables are nested more than {MOST_DEPTH} deep: expected [table] key")


def parse(raw: dict[str, Any], model: type[T], source: str = "config") -> T:
    """Validate a nested dict; the first fault becomes a one-line :class:`ConfigError`."""
    try:
        return model.model_validate(raw)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        raise ConfigError(f"{source}: {_explain(first, model, raw)}") from None


def _explain(fault: Any, model: type[BaseModel], raw: Any) -> str:
    where = _short(".".join(_place(fault["loc"], raw)))
    if fault["type"] == "extra_forbidden":
        fields = _fields_at(model, fault["loc"][:-1])
        return f"unknown key {where}; valid keys here: {', '.join(fields)}{nearest(fault['loc'][-1], fields)}"
    message = str(fault["msg"]).removeprefix("Value error, ")
    if not where:  # a fault of the whole file
        return message
    return f"{where} = {_short(repr(fault.get('input')))}: {message[:1].lower()}{message[1:]}"


def nearest(came: Any, names: Iterable[str]) -> str:
    """A hint at the nearest of the names, as the end of a message; empty where none is near."""
    from difflib import get_close_matches

    close = get_close_matches(str(came), list(names), 1)
    return f"; did you mean {close[0]}?" if close else ""


def _short(text: str) -> str:
    return text if len(text) <= 60 else text[:57] + "..."


def _place(loc: tuple[int | str, ...], raw: Any) -> list[str]:
    """The part of pydantic's path that stands in the file; the rest names types."""
    place = []
    for part in loc:
        in_list = isinstance(raw, list) and isinstance(part, int) and part < len(raw)
        if in_list or isinstance(raw, dict) and part in raw:
            raw = raw[part]
            place.append(str(part))
    return place or [str(part) for part in loc[:1]]


def _fields_at(model: type[BaseModel], loc: tuple[int | str, ...]) -> list[str]:
    for part in loc:
        field = model.model_fields.get(str(part))
        if field is not None and isinstance(field.annotation, type):
            if issubclass(field.annotation, BaseModel):
                model = field.annotation
    return sorted(model.model_fields)
