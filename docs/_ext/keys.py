"""The keys of the configuration and of a scenario, from their models."""

import importlib
import json
import re
from collections.abc import Iterator
from dataclasses import dataclass
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from annotated_types import Ge, Gt, Le, Len, Lt, MaxLen, MinLen
from markup import code, parameters, table
from pydantic import BaseModel
from pydantic.fields import FieldInfo

from rivid.core.settings import Limits
from rivid.input_config import Means

CLASS = re.compile(r":class:`~?([\w.]+)`")
NAMES = {"float": "number", "int": "whole number", "str": "text", "bool": "true or false",
         "date": "date", "Path": "path", "Any": "anything"}  # fmt: skip


@dataclass(frozen=True)
class Key:
    """One key of one table."""

    table: str
    name: str
    type: str
    unit: str
    default: str
    meaning: str


def sections(model: type[BaseModel]) -> Iterator[tuple[str, type[BaseModel], list[Key]]]:
    """Each table of a file with its model and keys; what stands above all tables is named ""."""
    plain = [_key("", name, field, model) for name, field in model.model_fields.items() if not _inner(field)]
    if plain:
        yield "", model, plain
    for name, field in model.model_fields.items():
        inner = _inner(field)
        if inner is not None:
            yield name, inner, [_key(name, key, one, inner) for key, one in inner.model_fields.items()]


def markdown(model: type[BaseModel]) -> str:
    """All tables, each under a heading of its own."""
    parts = []
    for name, section, keys in sections(model):
        first = (section.__doc__ or "").strip().split("\n\n")[0].replace("\n", " ")
        meaning = re.sub(r"^`\[\w+\]`: ", "", first)
        rows = [[code(k.name), k.type, k.unit, k.default, k.meaning] for k in keys]
        heading = f"## `[{name}]`\n\n{_sentence(meaning)}\n" if name else "## Above all tables\n"
        parts.append(f"{heading}\n{table(['key', 'type', 'unit', 'default', 'meaning'], rows)}")
    return "\n".join(parts)


def _sentence(text: str) -> str:
    text = re.sub(r"[,;:]? ?(the settings of|see) :class:`[^`]*`", "", text).strip(" .,")
    return f"{text[:1].upper()}{text[1:]}." if text and "`" not in text[:1] else text


def _inner(field: FieldInfo) -> type[BaseModel] | None:
    for part in (field.annotation, *get_args(field.annotation)):
        if isinstance(part, type) and issubclass(part, BaseModel):
            return part
    return None


def _key(table_name: str, name: str, field: FieldInfo, model: type[BaseModel]) -> Key:
    unit, meaning = _means(name, field, model)
    unit = "" if unit == "-" else unit
    default = field.get_default(call_default_factory=True)
    return Key(table_name, name, words(field.annotation, field.metadata), unit, _default(default), meaning)


def _means(name: str, field: FieldInfo, model: type[BaseModel]) -> tuple[str, str]:
    """Return unit and meaning of a key: its own, or those in the docstring of the class that it sets."""
    for part in field.metadata:
        if isinstance(part, Means):
            return part.unit, part.meaning
    for path in CLASS.findall(model.__doc__ or ""):
        module, cls = path.rsplit(".", 1)
        described = parameters(getattr(importlib.import_module(module), cls))
        if name in described:
            return described[name]
    return "-", ""


def _default(value: Any) -> str:
    if value is None or isinstance(value, BaseModel):
        return "not given"
    if isinstance(value, float):
        return f"`{value:g}`"
    if isinstance(value, str | bool | int):
        return code(json.dumps(value))
    if isinstance(value, list | tuple):
        return code(f"[{', '.join(f'{v:g}' if isinstance(v, float) else json.dumps(v) for v in value)}]")
    return "empty" if isinstance(value, dict) and not value else code(str(value))


def words(annotation: Any, metadata: Any = ()) -> str:
    """A type with its limits, in words.

    Examples
    --------
    >>> words(Annotated[float, Gt(0)] | Literal["bounds"])
    'number above 0, or `"bounds"`'
    >>> words(list[str]), words(tuple[int, ...] | None), words(dict[str, str])
    ('list of text', 'list of whole number', 'table of text')
    """
    origin, inside = get_origin(annotation), get_args(annotation)
    if origin is Annotated:
        return words(inside[0], [*inside[1:], *metadata])
    if origin is Literal:
        return ", ".join(code(json.dumps(value)) for value in inside)
    if origin in (Union, UnionType):
        return ", or ".join(words(part, metadata) for part in inside if part is not NoneType)
    if origin is tuple and (len(inside) != 2 or inside[1] is not Ellipsis):
        return f"{len(inside)} of: {words(inside[0])}"
    if origin in (list, tuple):
        return f"list of {words(inside[0])}"
    if origin is dict:
        return f"table of {words(inside[1])}"
    name = getattr(annotation, "__name__", str(annotation))
    return f"{NAMES.get(name, name)}{_limits(metadata)}"


def _limits(metadata: Any) -> str:
    parts: list[Any] = []
    for part in metadata:
        if isinstance(part, Limits):
            kinds = {"gt": Gt, "ge": Ge, "lt": Lt, "le": Le}
            parts += [kinds[name](value) for name, value in vars(part).items() if value is not None]
        else:
            parts += part.metadata if isinstance(part, FieldInfo) else [part]
    low = high = ""
    for part in parts:
        match part:
            case Gt(gt=value):
                low = f" above {_number(value)}"
            case Ge(ge=value):
                low = f" from {_number(value)}"
            case Lt(lt=value):
                high = f" below {_number(value)}"
            case Le(le=value):
                high = f" to {_number(value)}"
            case Len() | MinLen() | MaxLen():
                pass  # of texts and lists: the error names the limit
    both = low.startswith(" from") or not high
    return f"{low}{high}" if both else f"{low}, at most {high.split()[-1]}" if low else f" up to{high[3:]}"


def _number(value: Any) -> str:
    return f"{value:g}" if abs(value) >= 1e6 or abs(value) < 1e-3 else f"{value:,}".removesuffix(".0")
