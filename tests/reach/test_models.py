"""What holds for every reach response: linear, causal, the same for every day, refusing bad parameters."""

import dataclasses

import numpy as np
import pytest

from rivid.errors import ConfigError, RividError
from rivid.reach.models import MODELS, DiffusiveWave, Fir, IntegratorDelay, IntegratorResonance
from rivid.reach.models.base import Parameter, arriving, arriving_mean, split_delay

T_S = 133.0
NAMES = sorted(MODELS)
every_model = pytest.mark.parametrize("name", NAMES)
every_parameter = pytest.mark.parametrize(
    "name,parameter",
    [(n, p) for n in NAMES for p in MODELS[n].PARAMETERS],
    ids=lambda x: getattr(x, "name", x),
)


def flows(seed, shape=(250,)):
    rng = np.random.default_rng(seed)
    return rng.integers(-40, 41, shape).astype(float), rng.integers(-40, 41, shape).astype(float)


def quick(name):
    """The typical response, a river's brought near enough to answer within 250 samples."""
    model = MODELS[name].typical()
    nearer = {"diffusive-wave": {"length": 9_000.0}, "lag-and-reservoir": {"lag": 2_050.0}}
    return dataclasses.replace(model, **nearer.get(name, {}))


def test_the_names_are_the_canonical_ones():
    assert list(MODELS) == [
        "integrator-delay",
        "integrator-delay-zero",
        "integrator-resonance",
        "diffusive-wave",
        "lag-and-reservoir",
        "fir",
    ]
    assert all(model.NAME == name for name, model in MODELS.items())


@every_model
def test_parameters_are_the_fields_in_their_order(name):
    fields = [f.name for f in dataclasses.fields(MODELS[name]) if f.name != "integrating"]
    assert fields == [p.name for p in MODELS[name].PARAMETERS]


@every_model
def test_responses_and_parameters_are_frozen(name):
    model = MODELS[name].typical()
    with pytest.raises(dataclasses.FrozenInstanceError):
        setattr(model, model.PARAMETERS[0].name, 1.0)
    with pytest.raises(dataclasses.FrozenInstanceError):
        model.PARAMETERS[0].low = -1.0


@every_model
def test_docstrings_state_the_model_and_its_source(name):
    text = MODELS[name].__doc__
    assert "Source:" in text and "``" in text.split("Parameters\n")[0]
    for parameter in MODELS[name].PARAMETERS:
        assert parameter.name in text


@every_parameter
def test_a_value_outside_its_limits_is_refused_with_name_value_and_limits(name, parameter):
    model = MODELS[name].typical()
    sequence = isinstance(parameter.typical, tuple)
    for value in (
        parameter.low - 1.0,
        parameter.high * 2.0 + 1.0,
        float("nan"),
        float("inf"),
        True,
        "7",
        None,
    ):
        with pytest.raises(ConfigError) as error:
            dataclasses.replace(model, **{parameter.name: (0.0, value) if sequence else value})
        message = str(error.value)
        shown = f"{value:g}" if isinstance(value, float) else repr(value)
        for words in (name, parameter.name, f"= {shown}:", f"from {parameter.low:g} to {parameter.high:g}"):
            assert words in message
        assert "\n" not in message


@every_parameter
def test_the_limits_themselves_are_allowed_and_simulate(name, parameter):
    inflow, outflow = flows(1, (60,))
    for value in (parameter.low, parameter.high):
        held = (value,) * 3 if isinstance(parameter.typical, tuple) else value
        model = dataclasses.replace(MODELS[name].typical(), **{parameter.name: held})
        T = model.sample_time if isinstance(model, Fir) else T_S
        assert np.isfinite(model.simulate(T, inflow, outflow)).all()


def test_a_number_of_numpy_is_a_number_and_a_tuple_is_none():
    assert IntegratorDelay(np.float64(1e5), np.int64(300)).simulate(T_S, [1.0, 1.0])[0] == 0.0
    with pytest.raises(ConfigError, match="surface_area"):
        IntegratorDelay((1e5,), 300.0)


@every_model
@pytest.mark.parametrize("seed", range(5))
def test_responses_are_linear(name, seed):
    model = quick(name)
    a, b = flows(seed), flows(seed + 100)
    both = model.simulate(T_S, 2.0 * a[0] - 3.0 * b[0], 2.0 * a[1] - 3.0 * b[1])
    parts = 2.0 * model.simulate(T_S, *a) - 3.0 * model.simulate(T_S, *b)
    assert np.abs(both).max() > 0
    np.testing.assert_allclose(both, parts, rtol=0, atol=1e-12 * np.abs(both).max())


@every_model
@pytest.mark.parametrize("k", [1, 13, 100])
def test_what_comes_later_changes_nothing_before_it(name, k):
    model = quick(name)
    inflow, outflow = flows(k)
    changed_in, changed_out = inflow.copy(), outflow.copy()
    changed_in[k:] += 17.0
    changed_out[k:] -= 11.0
    first, second = model.simulate(T_S, inflow, outflow), model.simulate(T_S, changed_in, changed_out)
    np.testing.assert_array_equal(first[:k], second[:k])
    assert np.abs(first[k:] - second[k:]).max() > 0


@every_model
def test_the_same_flows_later_give_the_same_output_later(name):
    model = quick(name)
    inflow, outflow = flows(3)
    late = [np.concatenate([np.zeros(40), x]) for x in (inflow, outflow)]
    now = model.simulate(T_S, inflow, outflow)
    np.testing.assert_allclose(model.simulate(T_S, *late)[40:], now, rtol=0, atol=1e-13 * np.abs(now).max())


@every_model
def test_a_day_has_the_same_bits_alone_and_in_any_batch(name):
    model = quick(name)
    inflow, outflow = flows(5, (37, 250))
    together = model.simulate(T_S, inflow, outflow)
    for rows in (slice(0, 1), slice(3, 10), slice(36, 37)):
        np.testing.assert_array_equal(together[rows], model.simulate(T_S, inflow[rows], outflow[rows]))
    np.testing.assert_array_equal(together[17], model.simulate(T_S, inflow[17], outflow[17]))


@every_model
def test_every_response_is_the_sum_of_its_answers_to_pulses(name):
    """Linear and time-invariant: an FIR made of its pulse responses is the response itself."""
    model, n = quick(name), 250
    pulse, nothing = np.eye(1, n)[0], np.zeros(n)
    a = model.simulate(T_S, pulse, nothing)
    b = model.simulate(T_S, nothing, pulse)
    copy = Fir(tuple(a.tolist()), tuple(b.tolist()), T_S, integrating=False)
    inflow, outflow = flows(8)
    wanted = model.simulate(T_S, inflow, outflow)
    got = copy.simulate(T_S, inflow, outflow)
    np.testing.assert_allclose(got, wanted, rtol=0, atol=1e-12 * np.abs(wanted).max())


@every_model
@pytest.mark.parametrize("parts", [2, 7])
def test_held_inputs_are_exact_at_any_sampling(name, parts):
    """Sampling more often, with the commands held, must not move the samples that were there before."""
    if name == "fir":  # its coefficients are made for one sampling period, and refuse others
        with pytest.raises(ConfigError, match="sample_time"):
            quick(name).simulate(T_S / parts, *flows(2))
        return
    model = quick(name)
    inflow, outflow = flows(2)
    coarse = model.simulate(T_S, inflow, outflow)
    fine = model.simulate(T_S / parts, np.repeat(inflow, parts), np.repeat(outflow, parts))
    assert np.abs(coarse).max() > 0
    np.testing.assert_allclose(fine[::parts], coarse, rtol=0, atol=1e-11 * np.abs(coarse).max())


@every_model
def test_no_outflow_is_an_outflow_of_zero(name):
    inflow, _ = flows(4)
    model = quick(name)
    np.testing.assert_array_equal(model.simulate(T_S, inflow), model.simulate(T_S, inflow, 0.0 * inflow))


@every_model
def test_a_river_forgets_the_outflow_and_a_pool_does_not(name):
    inflow, outflow = flows(4)
    model = quick(name)
    same = np.array_equal(model.simulate(T_S, inflow), model.simulate(T_S, inflow, outflow))
    assert same == (model.OUTPUT == "discharge")


@pytest.mark.parametrize("inflow,outflow", [(np.zeros(0), None), (1.0, None), (np.zeros(5), np.zeros(6))])
def test_flows_of_wrong_shapes_are_refused(inflow, outflow):
    with pytest.raises(RividError, match="shape"):
        IntegratorDelay.typical().simulate(T_S, inflow, outflow)


@pytest.mark.parametrize("T_s", [0.0, -133.0, float("nan"), float("inf")])
def test_an_impossible_sampling_period_is_refused(T_s):
    with pytest.raises(ConfigError, match="sample_time"):
        DiffusiveWave.typical().simulate(T_s, np.ones(5))


def test_a_delay_on_a_sample_is_on_it_whatever_its_rounding():
    assert split_delay(0.3, 0.1)[0] == 3 and split_delay(0.3, 0.1)[1] < 1e-9
    assert split_delay(7 * 133.0, 133.0) == (7, 0.0)
    step = np.ones(6)
    np.testing.assert_array_equal(arriving(step, 0.3, 0.1), [0, 0, 0, 1, 1, 1])
    np.testing.assert_array_equal(arriving(step, 0.31, 0.1), [0, 0, 0, 0, 1, 1])
    np.testing.assert_allclose(arriving_mean(step, 0.31, 0.1), [0, 0, 0, 0.9, 1, 1], atol=1e-12)
    np.testing.assert_array_equal(arriving(step, 1e6, 0.1), np.zeros(6))


def test_a_parameter_prints_as_what_it_is():
    shown = repr(IntegratorResonance.PARAMETERS[1])
    assert shown.startswith("Parameter(name='period', unit='s', low=1.0")
    assert isinstance(IntegratorResonance.PARAMETERS[1], Parameter)
