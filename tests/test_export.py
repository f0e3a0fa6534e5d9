"""Test that exported models agree with the calibrated reach, and that their readers accept the files."""

import csv
import itertools
import json
from dataclasses import replace

import numpy as np
import pytest

import rivid
from rivid.cli.export import FORMATS as OFFERED
from rivid.config import Config, parse
from rivid.diagnosis.calibrated import ReachModel, load_model, write_model
from rivid.diagnosis.fit import Model
from rivid.diagnosis.noise.model import NoiseModel
from rivid.diagnosis.response.linear import LinearPool
from rivid.diagnosis.response.river import RiverResponse
from rivid.diagnosis.result import Diagnosis
from rivid.effects import CATALOGUE
from rivid.errors import ConfigError, NoDataError
from rivid.export import FORMATS, export, law_of, routing, state_space
from rivid.results.season import settings_of
from tests.diagnosis.responses import nominal, river_record, season
from tests.run.test_run import rivid as command

NOTHING = Diagnosis("no_gap", "nothing", "any")
NOISE = {"gauge_sd": 0.003, "walk_sd": 1e-4, "inflow_sd": 2.0, "inflow_memory": 3600.0, "level_sd": 0.0,
         "level_memory": 1200.0, "wave": 900.0}  # fmt: skip


def pool(kind="saint-venant", effects=()):
    """Return a pool's model and its record."""
    record = season(3)
    if kind == "saint-venant":
        reach = nominal(record)
    else:
        reach = LinearPool.nominal(record, kind, surface_area=6.7e5, delay=900.0)
    noise = NoiseModel(**NOISE, sample_time=record.sample_time, surface_area=reach.surface_area)
    model = Model(reach, noise, record.usual_output, record.usual_flow, 1e-3, effects, ((),) * len(effects))
    return ReachModel("pool", model, record.sample_time, {}), record


def river():
    """Return a river's model and its record."""
    record = river_record(np.random.default_rng(4))
    reach = RiverResponse.nominal(4.0 * 3600.0, 3600.0, record.usual_flow)
    noise = NoiseModel(1.0, 0.0, 0.0, 9e4, 2.0, 3e4, record.sample_time, None)
    model = Model(reach, noise, record.usual_flow, record.usual_flow, 0.5)
    return ReachModel("river", model, record.sample_time, {}), record


def written(reach, record, folder):
    """Write model.toml of a reach."""
    river = record.kind == "river"
    kind = "river" if river else "pool"
    config = parse({"reach": {"kind": kind, "sample_time": reach.sample_time}}, Config)
    write_model(folder / "model.toml", NOTHING, record, config, reach.model.effects, reach.model)
    return folder / "model.toml"


@pytest.mark.parametrize("made", [pool, lambda: pool("none"), lambda: pool("fir"), river])
def test_the_model_that_is_read_is_the_one_that_was_fitted(made, tmp_path):
    reach, record = made()
    again = load_model(written(reach, record, tmp_path))
    few = record.take([1, 2])
    np.testing.assert_allclose(again.model.baseline(few), reach.model.baseline(few), rtol=0, atol=2e-6)
    for name, value in vars(reach.noise).items():
        assert getattr(again.noise, name) == (value if value is None else pytest.approx(value))
    assert again.kind == reach.kind
    assert again.origin["days"] == record.days and again.origin["rivid"] == rivid.__version__


def test_a_file_without_a_calibration_or_with_a_broken_one_is_refused(tmp_path):
    path = written(*pool(), tmp_path)
    text = path.read_text()
    path.write_text(text.replace("HydraulicResponse", "Hydraulics"))
    with pytest.raises(ConfigError, match="'Hydraulics': expected one of HydraulicResponse"):
        load_model(tmp_path)
    path.write_text(text[: text.index("[calibration]")])
    with pytest.raises(ConfigError, match="no table \\[calibration\\]"):
        load_model(tmp_path)
    path.write_text(text.replace("gauge_sd", "gauge"))
    with pytest.raises(ConfigError, match="not complete"):
        load_model(path)


def stepped(model, column, samples):
    """Return the output after a step of one input, from the matrices alone."""
    x, found = np.zeros(len(model.A)), []
    u = np.eye(model.B.shape[1])[column]
    for _ in range(samples):
        found.append((model.C @ x + model.D @ u).item())
        x = model.A @ x + model.B @ u
    return np.array(found)


@pytest.mark.parametrize("made", [pool, lambda: pool("none"), river])
def test_the_state_space_answers_a_step_as_the_reach_does(made):
    reach, record = made()
    model, samples = state_space(reach), round(86400 / reach.sample_time)
    steps = reach.kernels(samples)
    assert steps["up"][-1] > 0.0 and (record.kind == "river" or steps["down"][-1] < 0.0)
    for column, expected in enumerate([steps["up"], steps["down"]][: len(model.inputs)]):
        found = stepped(model, column, samples)
        assert np.abs(found - expected).max() < 0.02 * np.abs(expected).max()
        dead = model.delays[column]
        assert not found[: dead + 1].any() and abs(found[dead + 1]) > 0.0
        assert np.abs(expected[: dead + 1]).max() < 0.01 * np.abs(expected).max()
    assert len(model.states) == len(model.A) and np.abs(np.linalg.eigvals(model.A)).max() <= 1.0 + 1e-9


def kalman_sd(model, samples):
    """Return the standard deviation of a reading, by the general filter; the first sample sets the level."""
    new = model.G @ model.Q @ model.G.T
    P = 0.0 * new
    still = [k for k, name in enumerate(model.states) if name == "unlogged inflow" or name.endswith(" noise")]
    for a, b in itertools.product(still, still):
        P[a, b] = new[a, b] / (1.0 - model.A[a, a] * model.A[b, b])
    for k, name in enumerate(model.states):
        if name == "level error":
            P[k, k] = 1e6
    found = []
    for _ in range(samples):
        S = (model.C @ P @ model.C.T + model.R).item()
        found.append(np.sqrt(S))
        K = P @ model.C.T / S
        P = P - K @ model.C @ P
        P = model.A @ P @ model.A.T + new
    return np.array(found)


@pytest.mark.parametrize("made", [pool, river])
def test_its_noise_is_that_of_the_filter(made):
    reach, record = made()
    model = state_space(reach)
    z = np.zeros((1, 60))
    z[0, 40:] = np.nan
    _, sd = reach.noise.ahead(z)
    assert record.kind == "pool" or model.states[-2:] == ("discharge noise", "unlogged inflow")
    P = kalman_sd(model, 41)  # a reading of the sample after the last one
    assert sd[0, 40] == pytest.approx(P[40], rel=1e-3)


def test_scipy_simulates_it():
    reach, _ = river()
    model = state_space(reach)
    from scipy.signal import dlsim

    _, found, *_ = dlsim(model.to_scipy(), np.ones((80, 1)))
    np.testing.assert_allclose(found[:, 0], stepped(model, 0, 80), atol=1e-12)


def test_python_control_simulates_it_in_closed_loop():
    control = pytest.importorskip("control")
    reach, _ = pool()
    made = state_space(reach)
    plant = made.to_control()
    assert plant.dt == reach.sample_time and plant.input_labels == ["u_Qi", "u_Qo"]
    law = control.ss([], [], [], [[60.0]], plant.dt, inputs=["h_L"], outputs=["u_Qo"])
    loop = control.interconnect([plant, law], inputs=["u_Qi"], outputs=["h_L", "u_Qo"])
    time = np.arange(400) * plant.dt
    found = control.forced_response(loop, time, np.ones((1, 400)) * 10.0).outputs
    dead = made.delays[0]
    assert not found[:, : dead + 1].any() and abs(found[1, -1] - 10.0) < 1.0  # inflow equals outflow


def test_the_files_of_a_state_space_are_the_same_model(tmp_path):
    from scipy.io import loadmat

    reach, record = river()
    paths = export(written(reach, record, tmp_path), tmp_path / "to", "state-space")
    assert [p.suffix for p in paths] == [".npz", ".mat", ".json"]
    npz, mat, text = np.load(paths[0]), loadmat(paths[1]), json.loads(paths[2].read_text())
    for name in ("A", "B", "C", "D", "G", "Q", "R"):
        np.testing.assert_array_equal(npz[name], mat[name])
        np.testing.assert_array_equal(npz[name], np.array(text[name]))
    assert text["inputs"] == ["u_Qi"] and text["outputs"] == ["Q_L"] and text["sample_time"] == 900.0
    assert text["about"]["units"] == {"u_Qi": "m3/s", "Q_L": "m3/s"} and text["about"]["days"] == record.days


@pytest.mark.parametrize("delay", [850.0, 931.0, 980.0])
def test_the_half_time_has_its_fraction_of_a_sample(delay):
    reach, record = pool()
    T = record.sample_time
    fine = replace(reach, sample_time=T / 10)
    assert reach.half_time == pytest.approx(fine.half_time, abs=0.3 * T)
    ramp = LinearPool.nominal(record, "none", surface_area=6.7e5, delay=delay)
    assert replace(reach, model=replace(reach.model, reach=ramp)).half_time == pytest.approx(delay, abs=1.0)


def test_routing_parameters_give_the_step_response(tmp_path):
    reach, record = pool("none")
    found = routing(reach)
    assert found["Ad"] == pytest.approx(6.7e5, rel=0.01) and found["delay"] == pytest.approx(900.0, abs=1.0)
    assert abs(found["p21"]) * 6.7e5 < 300.0 and abs(found["p22"]) * 6.7e5 < 300.0  # no front: only the step
    reach, record = river()
    found = routing(reach)
    up = reach.kernels(300)["up"]
    delay, *_, held, hold = (p.natural for p in reach.model.reach.parameters[:5])
    assert found["Lag_parameter"] + found["K_parameter"] == pytest.approx(delay + held * hold, rel=2e-3)
    time = 900.0 * np.arange(300)
    for at, share in ((found["Lag_parameter"], 0.1), (reach.half_time, 0.5)):
        assert np.interp(at, time, up / up[-1]) == pytest.approx(share, abs=1e-4)
    assert found["gain"] > 0.9
    paths = export(written(reach, record, tmp_path), tmp_path / "to", "rtc-tools")
    (row,) = csv.DictReader(paths[0].read_text().splitlines())
    block = {key.split(".")[1] for key in row}
    assert block == {"Lag_parameter", "K_parameter"}


LAW = (
    "discharge_low_m3s,discharge_high_m3s,discharge_m3s,delay_s,delay_low_s,delay_high_s,day_low_s,day_high_s,"
    "observed_s,n\n100,200,150,7300,7000,7600,6500,8100,7250,40\n200,400,300,3500,3300,3700,3100,3900,3480,60\n"
)


@pytest.fixture
def joined(tmp_path):
    """Return the results of `rivid season`."""
    (tmp_path / "delay_law.csv").write_text(LAW)
    (tmp_path / "delay_law.json").write_text(json.dumps({"reach": "gorge", "T0": 5000.0}))
    return tmp_path


def test_delays_by_discharge(joined):
    paths = export(joined, joined / "to", "csv")
    rows = list(csv.DictReader(paths[0].read_text().splitlines()))
    assert [float(r["delay_s"]) for r in rows] == [7300.0, 3500.0] and law_of(joined)[0][1]["n"] == 60.0
    assert json.loads(paths[1].read_text())["written_by"] == f"rivid {rivid.__version__}"


def test_a_law_of_another_run_is_refused(joined):
    config = {"input": {"units": {}}, "reach": {"name": "gorge"}, "posterior": {}}
    run = {"reach": "gorge", "config": config}
    law = {"reach": "gorge", "first": "2008-01-01", "last": "2008-12-31", "settings": settings_of(run)}
    (joined / "delay_law.json").write_text(json.dumps(law))
    (joined / "run.json").write_text(json.dumps(run | {"schema_version": 1}))
    assert law_of(joined)
    other = run | {"config": config | {"input": {"units": {"u_Qi": "cfs"}}}}
    (joined / "run.json").write_text(json.dumps(other | {"schema_version": 1}))
    with pytest.raises(ConfigError, match="is older than its last run .* run `rivid season"):
        export(joined, joined / "to", "csv")


def test_a_season_without_a_law_has_its_reason(joined):
    (joined / "delay_law.csv").write_text(LAW.partition("\n")[0] + "\n")
    (joined / "delay_law.json").write_text(json.dumps({"reach": "gorge", "message": "12 days: too few"}))
    with pytest.raises(NoDataError, match="no law of delay and discharge: 12 days: too few"):
        law_of(joined)


def test_links_of_pypsa(joined):
    paths = export(joined, joined / "to", "pypsa")
    rows = list(csv.DictReader(paths[0].read_text().splitlines()))
    assert [int(r["delay"]) for r in rows] == [2, 1] and {r["cyclic_delay"] for r in rows} == {"False"}
    assert [float(r["p_nom"]) for r in rows] == [
        200.0,
        200.0,
    ]  # flows up to 200, and from there to 400
    pypsa = pytest.importorskip("pypsa")
    network = pypsa.Network()
    network.import_from_csv_folder(joined / "to")
    assert network.links["delay"].tolist() == [2, 1] and not network.links["cyclic_delay"].any()


def test_delays_of_pypsa_are_counted_in_snapshots_and_a_remark_gives_those_of_none(joined):
    words = ("export", joined, "--to", "pypsa", "--out", joined / "to", "-q", "--snapshot")
    for snapshot, delays, remark in (
        (900, ["8", "4"], ""),
        (10_000, ["1", "0"], "delay = 0 in 1 of 2 links: 58.3 min round to 0 snapshots of 10000 s"),
    ):
        code, output = command(*words, snapshot)
        rows = csv.DictReader((joined / "to" / "links.csv").read_text().splitlines())
        assert code == 0 and [r["delay"] for r in rows] == delays
        assert (remark in output) if remark else output == ""
    assert command(*words, 0)[0] == 2


def test_the_command_and_its_errors(tmp_path):
    reach, record = pool()
    path = written(reach, record, tmp_path)
    code, output = command("export", path, "--to", "rtc-tools", "--out", tmp_path / "to")
    assert code == 0 and "parameters.csv" in output
    assert command("export", path, "--to", "state-space", "-q")[1] == ""
    assert (tmp_path / "export" / "state_space.mat").exists()
    code, output = command("export", tmp_path, "--to", "csv")
    assert code == 10 and "rivid season" in output
    assert tuple(FORMATS) == OFFERED  # the command does not import the writers for its help
    code, output = command("export", path, "--to", "csv")  # a file, not a run
    assert code == 10 and "rivid season" in output


def test_from_python(tmp_path):
    effects = (CATALOGUE["leakage"](loss=1.0),)
    reach, record = pool(effects=effects)
    model = rivid.load_model(written(reach, record, tmp_path))
    assert "saint-venant" in repr(model) and model.reach.model.effects[0].name == "leakage"
    assert model.state_space().outputs == ("h_L",) and set(model.routing()) == {"delay", "Ad", "p21", "p22"}
    assert model.step_responses(10)["up"].shape == (10,)
