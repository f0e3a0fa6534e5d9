"""Test that the reference is complete, that links of the pages have targets, and that the recipes work."""

import doctest
import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import click
import pyarrow.csv
import pyarrow.feather
import pyarrow.parquet
import pytest

import rivid
from rivid.config import Config
from rivid.effects import CATALOGUE
from rivid.errors import RividError
from rivid.simulation.scenario import Scenario
from tests.run.test_run import rivid as rivid_run

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
sys.path.insert(0, str(DOCS / "_ext"))

import contract  # noqa: E402
import keys  # noqa: E402
import layers  # noqa: E402
import links  # noqa: E402
import markup  # noqa: E402

PAGES = sorted(p for p in [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *DOCS.rglob("*.md")])
LINK = re.compile(r"!?\[[^\]]*\]\(([^)\s]+)\)")
BLOCK = re.compile(r"^```\{?([\w-]+)\}?.*?\n(.*?)^```$", re.M | re.S)


def names(page):
    return str(page.relative_to(ROOT))


@pytest.mark.parametrize("model", [Config, Scenario])
def test_every_key_has_a_type_and_a_meaning(model):
    page = keys.markdown(model)
    tables = list(keys.sections(model))
    assert [name for name, _, _ in tables if name]
    for name, section, found in tables:
        assert name == "" or f"## `[{name}]`" in page
        for key in found:
            assert f"| `{key.name}` |" in page
            assert key.meaning and key.type, f"[{name}] {key.name} has no meaning or type"
        if name:
            assert [key.name for key in found] == list(section.model_fields)


def test_units_defaults_and_limits_of_keys_are_those_of_the_models():
    found = {(k.table, k.name): k for model in (Scenario, Config)
             for _, _, of in keys.sections(model) for k in of}  # fmt: skip
    for table, name, unit in (
        ("reach", "sample_time", "s"), ("reach", "discharge_range", "m3/s"), ("jmap", "tolerance", ""),
        ("jmap", "d_min", "samples"), ("operators", "level_gain", "m2/s"),
    ):  # fmt: skip
        assert found[table, name].unit == unit
    d_max = found["jmap", "d_max"]
    assert d_max.default == f"`{Config().jmap.d_max}`" and '`"bounds"`' in d_max.type
    assert found["jmap", "order"].type.startswith("whole number from 6 to 1,000")
    assert found["jmap", "start"].default == "not given"


def test_every_column_of_every_table_has_a_meaning_in_the_reference():
    page = contract.results()
    for name, (schema, meanings) in contract.schemas().items():
        section = page.split(" and ".join(f"`{one}`" for one in name.split(", ")), 1)[1].split("## ")[0]
        for column in schema.names:
            assert meanings[column][1], f"{name}: {column} has no meaning"
            assert f"| `{column}` |" in section
    existing = {column for schema, _ in contract.schemas().values() for column in schema.names}
    assert all(set(meanings) <= existing for _, meanings in contract.schemas().values())


def test_the_columns_of_a_run_are_those_of_the_reference(tmp_path):
    from rivid.cli import cli

    week = str(ROOT / "sample_data/basse_isere_csv")
    words = ["run", week, "--out", str(tmp_path), "--estimator", "posterior", "--no-figures", "--quiet"]
    cli.main([*words, "--workers", "1"], standalone_mode=False)
    for name, (schema, _) in contract.schemas().items():
        for file in name.split(", "):
            if (tmp_path / file).exists() and file.endswith(".parquet"):
                assert pyarrow.parquet.read_schema(tmp_path / file).names == schema.names, file
    page = (DOCS / "reference/results.md").read_text(encoding="utf-8")
    record = page.split("## `run.json`")[1].split("## ")[0]
    for key in json.loads((tmp_path / "run.json").read_text(encoding="utf-8")):
        assert f"`{key}`" in record, f"run.json: {key} is not in the reference"


def test_every_effect_is_listed_with_its_parameters():
    page = contract.effects()
    for name, one in CATALOGUE.items():
        section = page.split(f"### `{name}`", 1)[1].split("### ")[0]
        assert one.sentence in section and one.looks in section
        for key, spec in one.parameters().items():
            assert f"| `{key}` |" in section and spec.meaning in section


def test_every_exit_code_is_in_the_reference_and_in_the_readme():
    kinds, found = [RividError], {0, 3}
    while kinds:
        one = kinds.pop()
        kinds += one.__subclasses__()
        if one.__module__ == "rivid.errors":
            found.add(one.exit_code)
    codes = set(contract.EXIT_CODES)
    assert found <= codes and {130, 143} <= codes
    assert all(f"| `{code}` |" in contract.exits() for code in codes)
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    table = re.search(r"\| code \| meaning .*?\n\n", readme, re.S)[0].strip()
    listed = {int(code) for row in table.splitlines() for code in re.findall(r"\d+", row.split("|")[1])}
    assert listed == codes


def test_every_command_and_its_options_have_help():
    from rivid.cli import COMMANDS, cli

    page = (DOCS / "reference/cli.md").read_text(encoding="utf-8")
    assert ".. click:: rivid.cli:cli" in page and ":nested: full" in page
    context = click.Context(cli)
    assert cli.list_commands(context) == list(COMMANDS)
    for name in COMMANDS:
        command = cli.get_command(context, name)
        assert command.help, name
        for option in command.params:
            if isinstance(option, click.Option) and not option.hidden:
                assert option.help, f"rivid {name} {option.opts[0]} has no help"


def test_every_public_name_is_in_the_reference():
    page = (DOCS / "reference/python.md").read_text(encoding="utf-8")
    for name in rivid.__all__:
        assert name == "__version__" or re.search(rf"(::|:members:) .*\b{name}\b", page), name


def test_the_figure_of_the_layers_has_all_folders_and_modules_with_a_description():
    drawn = layers.drawing()
    assert drawn.index("<b>cli/</b>") < drawn.index("<b>core/</b>") < drawn.index("<b>errors.py</b>")
    for name in set().union(*layers.layers()):
        assert layers.summary(name), f"{name} has no docstring"
        assert f"<b>{name}" in drawn


@pytest.mark.parametrize("page", PAGES, ids=names)
def test_every_link_and_picture_of_a_page_exists(page):
    text = page.read_text(encoding="utf-8")
    for target in LINK.findall(BLOCK.sub("", text)):
        if re.match(r"[a-z]+:", target):
            continue
        path, _, place = target.partition("#")
        linked = (page.parent / path).resolve() if path else page
        assert linked.exists(), f"{names(page)} links to {target}"
        if place:
            heads = re.findall(r"^#+ (.*)$", linked.read_text(encoding="utf-8"), re.M)
            slugs = {re.sub(r"[^\w\- ]", "", head.lower()).replace(" ", "-") for head in heads}
            assert place in slugs, f"{names(page)} links to {target}"


def test_every_page_is_in_the_site():
    listed = set()
    for page in [p for p in PAGES if DOCS in p.parents]:
        for block in re.findall(r"^```\{toctree\}\n(.*?)^```", page.read_text(encoding="utf-8"), re.M | re.S):
            lines = [line.strip() for line in block.splitlines() if line.strip() and not line.startswith(":")]
            listed |= {(page.parent / line).resolve() for line in lines}
    pages = {p.with_suffix("") for p in [*DOCS.rglob("*.md"), *DOCS.glob("*.ipynb")]}
    assert pages - listed == {DOCS / "index"}


def test_every_picture_of_the_guide_has_a_program_and_a_page():
    from benchmarks.guide_pictures import ALL

    drawn = {f"guide_{name}.png" for name in ALL}
    assert {p.name for p in (DOCS / "pictures").glob("guide_*")} == drawn
    shown = "".join(p.read_text(encoding="utf-8") for p in (DOCS / "guide").glob("*.md"))
    assert all(f"../pictures/{name}" in shown for name in drawn)


def test_broken_links_and_links_to_other_hosts_are_found(tmp_path):
    (tmp_path / "a.html").write_text('<p id="here"><a href="b.html#there">x</a><a href="https://x.org">y</a>')
    (tmp_path / "b.html").write_text(
        '<img src="https://x.org/y.png"><a href="a.html#here">x</a><a href="c.html">'
    )
    found = "\n".join(links.faults(tmp_path))
    assert "a.html leads to b.html#there: there is no such place" in found
    assert "b.html leads to c.html" in found and "b.html loads https://x.org/y.png" in found
    assert len(found.splitlines()) == 3


def test_the_examples_of_the_extensions_run():
    for module in (keys, markup):
        found = doctest.testmod(module)
        assert found.attempted and not found.failed


def test_numpydoc_parameters_are_parsed_with_units():
    class Weir:
        """A weir.

        Parameters
        ----------
        crest, bed : float
            Levels [m]; the bed | is lower.
        name : str
            Its name.

        Raises
        ------
        ValueError
            Never.
        """

    assert markup.parameters(Weir) == {
        "crest": ("m", "levels; the bed | is lower"), "bed": ("m", "levels; the bed | is lower"),
        "name": ("-", "its name"),
    }  # fmt: skip
    assert markup.table(["a"], [["x | y"]]).splitlines()[2] == "| x \\| y |"


def recipe(page, package):
    """Apply a page to a copy of the package: new files as captioned blocks, changes as diffs."""
    text = (DOCS / "built" / page).read_text(encoding="utf-8")
    for path, body in re.findall(
        r"^```\{code-block\} python\n:caption: (\S+)\n\n(.*?)^```", text, re.M | re.S
    ):
        (package / path).write_text(body, encoding="utf-8")
    changes = re.findall(r"^```diff\n--- (\S+)\n(.*?)^```", text, re.M | re.S)
    for path, body in changes:
        lines = body.splitlines(keepends=True)
        old = "".join(line[1:] or "\n" for line in lines if line[0] != "+")
        new = "".join(line[1:] or "\n" for line in lines if line[0] != "-")
        source = (package / path).read_text(encoding="utf-8")
        assert source.count(old) == 1, f"{page}: {path} has these lines {source.count(old)} times:\n{old}"
        (package / path).write_text(source.replace(old, new), encoding="utf-8")
    return len(changes)


@pytest.fixture
def scratch(tmp_path):
    shutil.copytree(ROOT / "rivid", tmp_path / "rivid", ignore=shutil.ignore_patterns("__pycache__"))

    def run(*arguments):
        environment = os.environ | {"PYTHONPATH": str(tmp_path)}
        words = ["run", *map(str, arguments), "--workers", "1", "--quiet"]
        command = [sys.executable, "-P", "-m", "rivid", *words]
        done = subprocess.run(command, env=environment, cwd=tmp_path, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr

    return tmp_path, run


def test_the_recipe_for_an_estimator_works(scratch):
    package, run = scratch
    assert recipe("estimator.md", package) == 1
    out = package / "out"
    run(ROOT / "sample_data/basse_isere_csv", "--estimator", "peak", "--out", out)
    rows = pyarrow.csv.read_csv(out / "delays.csv")
    assert rows["estimator"].to_pylist() == ["peak"] * 7 and rows["status"].to_pylist() == ["ok"] * 7
    assert all(1 <= d <= 15 for d in rows["delay_samples"].to_pylist())
    assert "peak of the correlation of moves" in (out / "report.html").read_text(encoding="utf-8")


def test_the_recipe_for_a_reader_works(scratch):
    package, run = scratch
    assert recipe("reader.md", package) == 2
    week, logs = ROOT / "sample_data/basse_isere_csv", package / "logs"
    logs.mkdir()
    for path in week.glob("*.csv"):
        table = pyarrow.csv.read_csv(path)
        pyarrow.feather.write_feather(table, logs / f"{path.stem}.feather")
    config = package / "reach.toml"
    config.write_text('[input]\ntime_zone = "Etc/GMT-1"\n')
    words = ("--config", config, "--no-figures", "--out")
    run(logs, *words, package / "by_feather")
    assert rivid_run("run", week, *words, package / "by_csv")[0] == 0
    tables = [(package / out / "delays.csv").read_bytes() for out in ("by_csv", "by_feather")]
    assert tables[0] == tables[1] and tables[0].count(b"\n") == 15
