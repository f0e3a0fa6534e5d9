"""Test every --help: the same name and wording for the same thing, and examples that run as written."""

import datetime as dt
import importlib
import re
import shlex
import subprocess
import sys
from pathlib import Path

import click
import pytest

from rivid.cli import COMMANDS, cli
from rivid.simulation.scenario import load_scenario

OF = {name: importlib.import_module(f"rivid.cli.{name}").command for name in COMMANDS}
FIRST = ["config", "out"]
LAST = ["first", "last", "workers", "dry_run", "as_json", "quiet", "verbose", "today"]
FAST = ("bounds", "completion", "effects", "sniff")
SLOW = ("check", "ingest", "simulate")
"""Commands with examples that are run here; the examples of the others are parsed."""


def help_of(rivid, name=None):
    return rivid(*([name] if name else []), "--help").output


def examples(text):
    """Return the commands in the indented sections, with continued lines joined."""
    lines = text.replace("\\\n", " ").splitlines()
    return [line.strip() for line in lines if line.startswith("    rivid ")]


def words_of(line):
    words = shlex.split(line)
    if ">" in words:
        words = words[: words.index(">")]
    assert words[0] == "rivid"
    return words[1:]


@pytest.mark.parametrize("name", [None, *COMMANDS])
def test_a_help_fits_eighty_columns_and_its_examples_use_existing_options_and_files(rivid, project, name):
    text = help_of(rivid, name)
    assert max(map(len, text.splitlines())) <= 80
    found = [words_of(line) for line in examples(text)]
    assert name is None or any(words[0] == name for words in found)
    for words in found:
        OF[words[0]].make_context(words[0], words[1:])  # raises for an unknown option
        for word in words[1:]:
            if "/" in word and not re.fullmatch(
                r"\d+/\d+|[A-Z]\w+/\S+|\S+://\S+", word
            ):  # a shard, a zone, a URL
                assert (project / word).exists() or word.startswith("out"), (words, word)


@pytest.mark.parametrize("name", [*FAST, *(pytest.param(name, marks=pytest.mark.long) for name in SLOW)])
def test_examples_run_as_written(rivid, project, name):
    for line in examples(help_of(rivid, name)):
        done = rivid(*words_of(line))
        assert done.code == 0 and done.stdout, (line, done.output)


def test_days_of_examples_lie_in_the_record_that_they_simulate(rivid, project):
    lines = [words_of(line) for line in examples(help_of(rivid, "diagnose"))]
    made = {
        words[words.index("--out") + 1]: load_scenario(words[1]) for words in lines if "simulate" in words
    }
    asked = [(made[words[1]], dt.date.fromisoformat(words[words.index("--to") + 1]))
             for words in lines if "--to" in words]  # fmt: skip
    assert asked and all(s.first_day <= last < s.first_day + dt.timedelta(s.days - 1) for s, last in asked)


@pytest.mark.long
def test_the_two_examples_of_rivid_itself_run(rivid, project):
    lines = examples(help_of(rivid))
    assert [words_of(line)[0] for line in lines] == ["check", "run"]
    for line in lines:
        assert rivid(*words_of(line)).code == 0
    assert Path("out/report.html").is_file()


def options(name):
    return [p for p in OF[name].params if isinstance(p, click.Option)]


def test_an_option_is_the_same_in_every_command():
    shapes = {}
    for name in COMMANDS:
        for option in options(name):
            metavar = option.metavar if option.name != "out" else ""
            shape = (option.opts, option.is_flag, option.multiple, metavar)
            assert shapes.setdefault(option.name, shape) == shape, (name, option.name)
    assert shapes["config"][0] == ["--config", "-c"] and shapes["out"][0] == ["--out", "-o"]
    assert shapes["quiet"][0] == ["--quiet", "-q"] and shapes["verbose"][0] == ["--verbose", "-v"]


@pytest.mark.parametrize("name", COMMANDS)
def test_options_have_one_order_help_texts_and_metavars(name):
    for option in options(name):
        assert option.help and option.help.endswith("."), option.name
        assert option.is_flag or option.metavar or isinstance(option.type, click.Choice), option.name
    names = [option.name for option in options(name)]
    own = [i for i, one in enumerate(names) if one not in FIRST + LAST]
    first = [names.index(one) for one in FIRST if one in names]
    last = [names.index(one) for one in LAST if one in names]
    assert first == sorted(first) and last == sorted(last)
    assert not own or not first or max(first) < min(own)
    if name != "run":  # --engine and --scheduler follow --workers
        assert not own or not last or max(own) < min(last)


@pytest.mark.parametrize(
    "name", ["run", "diagnose", "check", "ingest", "simulate", "figures", "fleet", "season"]
)
def test_slow_commands_have_quiet_and_verbose_but_not_both(rivid, tmp_path, name):
    assert {"quiet", "verbose"} <= {option.name for option in options(name)}
    if name in ("run", "figures"):
        done = rivid(name, tmp_path, "-q", "-v")
        assert done.code == 2 and "--quiet and --verbose" in str(done.exception)


def test_help_loads_nothing_heavy():
    heavy = "numpy pandas matplotlib scipy pyarrow pydantic numba"
    code = (
        "import sys\nfrom rivid.cli import COMMANDS, cli\n"
        "for name in COMMANDS:\n    cli.main([name, '--help'], standalone_mode=False)\n"
        f"print('loaded', [m for m in {heavy.split()} if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.stdout.splitlines()[-1] == "loaded []", done.stdout + done.stderr


def test_every_command_is_one_of_the_group():
    context = click.Context(cli)
    assert {name: cli.get_command(context, name) for name in cli.list_commands(context)} == OF
