"""Test that the notebook of the tour runs from its first cell to its last."""

import ast
import json
import os
from pathlib import Path

import numpy as np
import pytest

import rivid

TOUR = Path(__file__).parents[1] / "docs" / "tour.ipynb"
LAST = "## What is missing?"


def cells(path=TOUR):
    return json.loads(path.read_text(encoding="utf-8"))["cells"]


def run(cells, monkeypatch):
    """Execute code cells in order; return the value of each one's last expression, like a notebook."""
    monkeypatch.chdir(TOUR.parent)
    names, shown = {}, {}
    for cell in cells:
        if cell["cell_type"] != "code":
            continue
        source = "".join(cell["source"])
        *before, last = (ast.get_source_segment(source, node) for node in ast.parse(source).body)
        for statement in before:
            exec(compile(statement, cell["id"], "exec"), names)
        try:
            value = compile(last, cell["id"], "eval")
        except SyntaxError:
            exec(compile(last, cell["id"], "exec"), names)
        else:
            shown[cell["id"]] = eval(value, names)
    return names, shown


def test_all_but_the_diagnosis_runs_and_shows_pictures(monkeypatch, capsys):
    every = cells()
    before = next(i for i, cell in enumerate(every) if "".join(cell["source"]).startswith(LAST))
    names, shown = run(every[:before], monkeypatch)
    plots = {name: value for name, value in shown.items() if name.endswith("-plot")}
    assert list(plots) == ["day-plot", "jmap-plot", "posterior-plot", "simulate-plot"]
    assert all(plot._repr_png_().startswith(b"\x89PNG") for plot in plots.values())
    assert isinstance(shown["day"], rivid.Day) and names["probable"].status == "ok"
    assert "right on" in capsys.readouterr().out


@pytest.mark.long
def test_the_tour_runs_to_its_end_and_finds_the_bypass(monkeypatch):
    names, shown = run(cells(), monkeypatch)
    assert "unlogged_upstream_release" in {effect.name for effect in names["found"].effects}
    assert shown["diagnose-plot"]._repr_png_().startswith(b"\x89PNG")


def test_the_notebook_holds_no_output_and_no_place_of_one_machine():
    for cell in cells():
        if cell["cell_type"] == "code":
            assert cell["outputs"] == [] and cell["execution_count"] is None
    assert os.path.expanduser("~") not in TOUR.read_text(encoding="utf-8")


@pytest.mark.long
def test_the_loop_of_the_notebook_on_control_is_stable_and_better_with_the_dead_time(monkeypatch):
    names, shown = run(cells(TOUR.with_name("control.ipynb")), monkeypatch)
    assert shown["diagnose"][0] == ("u_Qi", "u_Qo") and shown["diagnose"][2][0] >= 4
    alone, both = (answer for answer in names["answers"].values())
    assert np.abs(alone[0]).max() > 2.0 * np.abs(both[0]).max()
    for level, outflow in (alone, both):
        assert 40.0 < outflow[-1] < 65.0 and np.abs(level[-20:]).max() < np.abs(alone[0]).max()
