"""The configuration with which the logs that were written are read: `[input]` says no more of the exports."""

import json
from hashlib import sha256
from pathlib import Path
from typing import Any, Literal

from rivid.atomic import write_text
from rivid.config import Config, parse
from rivid.errors import ConfigError
from rivid.logs.files import shown

KEPT = ("time_zone", "max_gap", "max_filled", "not_sentinels")
"""What says how days are made of values, not what a file looks like."""


def settings_for_logs(config: Config) -> str:
    """A configuration, as TOML, for the logs made of exports.

    Parameters
    ----------
    config : Config
        Of the exports.

    Raises
    ------
    ConfigError
        Where the rest of the configuration cannot do with that `[input]`.
    """
    raw = config.model_dump(mode="json", exclude_unset=True, exclude_none=True)
    given = raw.pop("input", {})
    own = {key: given[key] for key in KEPT if key in given}
    if config.input.u_Qo == "" and config.reach.kind == "pool":
        own["u_Qo"] = ""
    intervals = {name: seconds for name, seconds in config.input.interval.items()}
    if intervals:
        own["interval"] = intervals
    raw = {key: value for key, value in raw.items() if key in ("reach",)} | {"input": own} | raw
    parse(raw, Config, "the configuration for the logs")
    lines: list[str] = []
    for section, entries in raw.items():
        if entries:
            lines += ["", *_table(section, entries)]
    body = "\n".join(lines) + "\n"
    return _first_line(body) + body


def _first_line(body: str) -> str:
    """The first line of what ingest writes: it tells, of the rest, whether people have changed it."""
    mark = sha256(body.encode()).hexdigest()[:12]
    return (
        f"# Written by `rivid ingest` for the logs it made of the exports; it keeps this up to date. {mark}\n"
    )


def _table(name: str, entries: dict[str, Any]) -> list[str]:
    inner = {key: value for key, value in entries.items() if isinstance(value, dict)}
    lines = [f"[{name}]"]
    lines += [f"{key} = {_said(value)}" for key, value in entries.items() if key not in inner]
    for key, value in inner.items():
        if value:
            lines += ["", *_table(f"{name}.{key}", value)]
    return lines


def _said(value: Any) -> str:
    # JSON strings, numbers and lists are TOML ones too, but for escapes that JSON alone knows
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007F")


Standing = Literal["absent", "same", "own", "other"]


def standing(path: Path, text: str) -> Standing:
    """What is there in place of the settings: nothing, the same, others that ingest wrote, or others."""
    if not path.exists():
        return "absent"
    try:
        there = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError):
        return "other"
    if there == text:
        return "same"
    first, _, body = there.partition("\n")
    return "own" if f"{first}\n" == _first_line(body) else "other"


def refuse_settings(path: Path) -> None:
    """Refuse to overwrite unasked what people wrote, or what other logs are read with.

    Raises
    ------
    ConfigError
    """
    raise ConfigError(
        f"{shown(str(path))} is there and says otherwise: --force writes it and differing days again, "
        "--run-config writes it elsewhere"
    )


def write_settings(path: Path, text: str) -> None:
    """Write it whole or not at all."""
    write_text(path, text)
