"""Options and arguments that several commands share: one name, one text, one order.

The order in a command: config, out, its own options, from, to, workers, dry-run, json, quiet, verbose.
"""

from collections.abc import Callable
from functools import wraps
from pathlib import Path
from typing import Any

import click

from rivid.cli.console import Console
from rivid.errors import nearest

Decorator = Callable[[Any], Any]

PATH = click.Path(path_type=Path)
FILE = click.Path(path_type=Path, dir_okay=False)
DIRECTORY = click.Path(path_type=Path, file_okay=False)
SEARCHED = "default: rivid.toml in DATA_DIR or above it, else Table I."
CONFIG_OF_FLEET = f"The reach and its settings (TOML), or a fleet's directory of them; {SEARCHED}"


class _NewDirectory(click.Path):
    """A directory that need not exist; a file in its place is an error of the command that writes there."""

    def shell_complete(self, ctx: click.Context, param: click.Parameter, incomplete: str) -> Any:
        return DIRECTORY.shell_complete(ctx, param, incomplete)


NEW_DIRECTORY = _NewDirectory(path_type=Path)


class OneOf(click.Choice):  # type: ignore[type-arg]  # generic only in later versions of click
    """A choice with a suggestion for a mistyped value."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        try:
            return super().convert(value, param, ctx)
        except click.BadParameter as error:
            if param and param.multiple and "," in str(value):
                each = " ".join(f"{param.opts[0]} {one.strip()}" for one in value.split(","))
                self.fail(f"{value!r} is a list; repeat the option: {each}", param, ctx)
            self.fail(f"{error.message.rstrip('.')}{nearest(value, map(str, self.choices))}", param, ctx)


class _Date(click.DateTime):
    """A date such as 2008-03-14."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        try:
            return super().convert(value, param, ctx).date()
        except click.BadParameter:
            self.fail(f"{value!r} came, a date like 2008-03-14 is expected.", param, ctx)


DATE = _Date(["%Y-%m-%d"])


def value(name: str, kind: Any, metavar: str, text: str, *names: str, **more: Any) -> Decorator:
    """Return an option with a value; `names` are its short name, or that of the command's argument."""
    return click.option(name, *names, type=kind, metavar=metavar, help=text, **more)


def flag(name: str, text: str, *names: str) -> Decorator:
    """Return an option without a value; `names` as of :func:`value`."""
    return click.option(name, *names, is_flag=True, help=text)


data_dir = click.argument("data_dir", type=PATH)


def exports(required: bool = True) -> Decorator:
    """EXPORTS, foreign files."""
    kind = click.Path(path_type=Path, exists=True, dir_okay=False)
    return click.argument("exports", nargs=-1, required=required, type=kind)


results = click.argument("out", type=DIRECTORY)
"""OUT, the directory that a run has written."""


def config(
    text: str = f"The reach and its settings (TOML); {SEARCHED}", kind: click.Path = FILE, **more: Any
) -> Decorator:
    """--config, -c."""
    return value("--config", kind, "FILE", text, "-c", **more)


out = value(
    "--out", NEW_DIRECTORY, "DIR",
    "Directory of the results; default: [run] out of the configuration, else ./out.", "-o",
)  # fmt: skip
logs_out = value("--out", NEW_DIRECTORY, "DATA_DIR", "Directory of the daily logs.", "-o", required=True)


def days(verb: str) -> Decorator:
    """--from and --to."""
    last = value("--to", DATE, "DATE", f"Last day to {verb}.", "last")
    return lambda command: first_day(verb)(last(command))


def first_day(verb: str) -> Decorator:
    """--from."""
    return value("--from", DATE, "DATE", f"First day to {verb}.", "first")


def as_json(text: str = "One JSON object on stdout.") -> Decorator:
    """--json."""
    return flag("--json", text, "as_json")


quiet = flag("--quiet", "Print only errors and warnings.", "-q")


def talk(command: Any) -> Any:
    """--quiet and --verbose, as the argument `console` of the command."""

    @wraps(command)
    def talking(quiet: bool, verbose: bool, **given: Any) -> Any:
        return command(console=Console(quiet, verbose), **given)

    verbose = flag("--verbose", "Print files, versions and the time of each phase on stderr.", "-v")
    return quiet(verbose(talking))


today = value("--today", DATE, "DATE", "Take DATE for today.", hidden=True)
"""--today, for tests."""
