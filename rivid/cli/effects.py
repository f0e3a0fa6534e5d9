"""``rivid effects``."""

import inspect
import json
import textwrap
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from rivid.cli import options as shared
from rivid.cli.console import wrap

if TYPE_CHECKING:
    from rivid.effects import Effect

TITLES = {
    "flow": "Flows that the logs do not hold, and storage",
    "timing": "Timing: what comes earlier, later or smoother than logged",
    "level": "Level: what the gauge gives beside the water",
}
WINDOW = (
    "dates = [2008-03-01, 2008-04-15]  # first and last day; leave out: always\n"
    "hours = [22, 6]  # from and to, here past midnight; leave out: all day"
)


def _names(context: click.Context, param: click.Parameter, typed: str) -> list[str]:
    """The effects, for the shell: read from their modules, as importing these takes longer than one waits."""
    import re

    modules = sorted(Path(__file__).parents[1].joinpath("effects").glob("*.py"))
    found = (re.findall(r'^    name = "(\w+)"', path.read_text(encoding="utf-8"), re.M) for path in modules)
    return [name for names in found for name in names if name.startswith(typed)]


@click.command("effects", short_help="What a simulation may lack: the catalogue of effects.")
@click.argument("name", required=False, shell_complete=_names)
@click.option("--effects-file", type=shared.FILE, metavar="FILE", help="A Python file with effects of yours.")
@shared.as_json("The catalogue, or that effect, as JSON on stdout.")
def command(name: str | None, effects_file: Path | None, as_json: bool) -> int:
    """The catalogue of effects: parameters, units, limits, and what each looks like.

    With NAME, that effect in full, with an example for a scenario.

    \b
    Examples:
      rivid effects
      rivid effects side_storage
      rivid effects --effects-file configs/scenarios/outside/hunting.py --json
    """
    from rivid.effects import FAMILIES, effect_classes
    from rivid.errors import ConfigError

    classes = effect_classes(effects_file)
    if name is not None and name not in classes:
        near = shared.nearest(name, list(classes))
        raise ConfigError(f"no effect is called {name!r}: expected one of {', '.join(classes)}.{near}")
    if as_json:
        shown = [_record(one) for one in classes.values()]
        click.echo(json.dumps(shown if name is None else _record(classes[name]), indent=1))
    elif name is not None:
        click.echo(_in_full(classes[name]))
    else:
        for family in FAMILIES:
            click.echo(f"{TITLES[family]}\n")
            for one in classes.values():
                if one.family == family:
                    click.echo(_entry(one))
        click.echo(wrap("`rivid effects NAME` says more of one, with an example for a scenario."))
    return 0


def _entry(one: "type[Effect]") -> str:
    lines = [one.name, wrap(one.sentence, 4), *_parameters(one, 4)]
    if not one.windowed:
        lines.append(wrap("Always there: takes no dates and hours.", 4))
    lines.append(wrap(f"Looks like: {one.looks}", 4, 2))
    return "\n".join(lines) + "\n"


def _parameters(one: "type[Effect]", indent: int) -> list[str]:
    usual = one.defaults()
    lines = []
    for key, said in one.parameters().items():
        of_each = ", or a list" if said.many and usual[key] != () else ""
        shown = f"{key} = {_value(usual[key])} [{said.unit}], {said.low:g} to {said.high:g}{of_each}"
        lines.append(wrap(f"{shown}: {said.meaning}", indent, 4))
    return lines


def _value(value: Any) -> str:
    return json.dumps(list(value)) if isinstance(value, tuple) else f"{value:g}"


def _in_full(one: "type[Effect]") -> str:
    when = "May be limited to dates and hours." if one.windowed else "Always there: takes no dates and hours."
    lines = [
        f"{one.name} ({one.family})", wrap(one.sentence, 2), "",
        *(line for part in _paragraphs(one) for line in (wrap(part, 2), "")),
        *_parameters(one, 2), "",
        wrap(when, 2), "",
        wrap(f"Looks like: {one.looks}", 2, 2), "",
        "In a scenario:", "",
        textwrap.indent(example(one), "    "),
    ]  # fmt: skip
    return "\n".join(lines)


def _paragraphs(one: "type[Effect]") -> list[str]:
    """What the class says of itself, its equation first."""
    said = inspect.cleandoc(one.__doc__ or "").split("\n\nParameters\n")[0].replace("``", "")
    made = said.startswith(f"{one.__name__}(")  # by dataclass, for want of any
    return [] if made or not said else said.split("\n\n")


def example(one: "type[Effect]") -> str:
    """A table for a scenario, with the usual values of all parameters."""
    lines = ["[[effects]]", f'name = "{one.name}"']
    for key, value in one.defaults().items():
        lines.append(f"{key} = {_value(value)}  # {one.parameters()[key].unit}")
    return "\n".join(lines + ([WINDOW] if one.windowed else []))


def _record(one: "type[Effect]") -> dict[str, Any]:
    usual = one.defaults()
    return {
        "name": one.name,
        "family": one.family,
        "sentence": one.sentence,
        "looks": one.looks,
        "windowed": one.windowed,
        "parameters": [
            {
                "name": key, "unit": said.unit, "low": said.low, "high": said.high,
                "default": usual.get(key), "many": said.many, "meaning": said.meaning,
            }
            for key, said in one.parameters().items()
        ],
    }  # fmt: skip
