"""``rivid effects``."""

import inspect
import json
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from rivid.cli import options as shared
from rivid.cli.console import wrap

if TYPE_CHECKING:
    from rivid.effects import Effect

TITLES = {
    "flow": "Unlogged flows, and storage",
    "timing": "Timing: commands or waves earlier, later or smoother than logged",
    "level": "Level: errors of the gauge",
}
WINDOW = (
    "dates = [2008-03-01, 2008-04-15]  # first and last day; leave out: always\n"
    "hours = [22, 6]  # from and to, here past midnight; leave out: all day"
)


def _names(context: click.Context, param: click.Parameter, typed: str) -> list[str]:
    """Return the effects for shell completion, read from the source: importing the modules is slow."""
    modules = sorted(Path(__file__).parents[1].joinpath("effects").glob("*.py"))
    found = (re.findall(r'^    name = "(\w+)"', path.read_text(encoding="utf-8"), re.M) for path in modules)
    return [name for names in found for name in names if name.startswith(typed)]


@click.command("effects")
@click.argument("name", required=False, shell_complete=_names)
@shared.value("--effects-file", shared.FILE, "FILE", "A Python file with your own effects.")
@shared.as_json("The catalogue, or that effect, as JSON on stdout.")
def command(name: str | None, effects_file: Path | None, as_json: bool) -> int:
    """Print the catalogue of effects: parameters, units, limits, and the symptoms of each.

    With NAME, that effect in full, with an example for a scenario.

    \b
    Examples:
      rivid effects
      rivid effects side_storage
      rivid effects --effects-file configs/scenarios/outside/hunting.py --json
    """
    from rivid.effects import effect_classes
    from rivid.errors import ConfigError, nearest
    from rivid.report.page import terminal

    classes = effect_classes(effects_file)
    if name is not None and name not in classes:
        raise ConfigError(
            f"no effect is called {name!r}: expected one of {', '.join(classes)}{nearest(name, classes)}"
        )
    records = {one.name: _record(one) for one in classes.values()}
    if as_json:
        click.echo(json.dumps(list(records.values()) if name is None else records[name], indent=1))
        return 0
    one = None if name is None else classes[name]
    text = terminal(
        "effects", effects=list(records.values()), full=one and records[one.name], titles=TITLES,
        paragraphs=_paragraphs(one) if one else [], example=example(one) if one else "",
        wrap=wrap, shown=_value,
    )  # fmt: skip
    click.echo(text)
    return 0


def _value(value: Any) -> str:
    return json.dumps(list(value)) if isinstance(value, tuple) else f"{value:g}"


def _paragraphs(one: "type[Effect]") -> list[str]:
    """Return the paragraphs of the class's docstring, with its equation first."""
    text = inspect.cleandoc(one.__doc__ or "").split("\n\nParameters\n")[0].replace("``", "")
    generated = text.startswith(f"{one.__name__}(")  # dataclass generates one where there is none
    return [] if generated or not text else text.split("\n\n")


def example(one: "type[Effect]") -> str:
    """Return a table for a scenario, with the default values of all parameters."""
    lines = ["[[effects]]", f'name = "{one.name}"']
    for key, value in one.defaults().items():
        lines.append(f"{key} = {_value(value)}  # {one.parameters()[key].unit}")
    return "\n".join(lines + ([WINDOW] if one.windowed else []))


def _record(one: "type[Effect]") -> dict[str, Any]:
    usual = one.defaults()
    return {
        "name": one.name, "family": one.family, "sentence": one.sentence, "looks": one.looks,
        "windowed": one.windowed,
        "parameters": [
            {
                "name": key, "unit": spec.unit, "low": spec.low, "high": spec.high,
                "default": usual.get(key), "many": spec.many, "meaning": spec.meaning,
            }
            for key, spec in one.parameters().items()
        ],
    }  # fmt: skip
