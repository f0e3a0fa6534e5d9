"""The model in the simulator: a reach response with effects, and its calibration by whitened least squares.

Levenberg and Marquardt's steps on the posterior of the response's and the effects' parameters together; the
noise and the weights of days are refitted between steps, and a step is kept only if the cost falls.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from rivid.diagnosis.blocks import Split
from rivid.diagnosis.data import Record
from rivid.diagnosis.gap import residual_of
from rivid.diagnosis.model.linear import Linear
from rivid.diagnosis.noise import NoiseModel, day_weights, fit_noise
from rivid.diagnosis.response.base import Response, vector_of
from rivid.effects import Effect, changes_of
from rivid.errors import RividError
from rivid.reach.changes import Changes
from rivid.types import Floats

WIDE = 10.0
"""Prior standard deviation of an effect's parameter, in units of its value: hardly any prior."""
ENOUGH = 2.0
"""Steps end when the cost falls by less [nats]."""
TRIES = 5
MOST_STEPS = 8


@dataclass(frozen=True, eq=False)
class Model:
    """A response with what was added to it.

    Attributes
    ----------
    reach : Response
    noise : NoiseModel or None
        None before the first fit.
    level, flow : float
        What level- and flow-dependent effects count from.
    gauge_floor : float
        Lower limit of the gauge noise.
    effects : tuple of Effect
    free : tuple of tuple of str
        The parameters of each that are fitted.
    level_noise : bool
        Whether the noise has a level part.
    """

    reach: Response
    noise: NoiseModel | None
    level: float
    flow: float
    gauge_floor: float
    effects: tuple[Effect, ...] = ()
    free: tuple[tuple[str, ...], ...] = ()
    level_noise: bool = False

    def changes(self, record: Record, more: tuple[Effect, ...] = ()) -> Changes:
        """What the effects change on a record."""
        return changes_of((*self.effects, *more), record.world(self.level, self.flow))

    def baseline(self, record: Record, more: tuple[Effect, ...] = ()) -> Floats:
        """Output about the observed course, with further effects; shape (days, n)."""
        return self.reach.baseline(record, self.changes(record, more))

    def values(self) -> Floats:
        """The effects' free parameters, one after the other."""
        return np.array([value for _, _, value in self.slots()])

    def slots(self) -> list[tuple[int, tuple[str, int | None], float]]:
        """The effects' free numbers: which effect, which parameter and place in it, and the value."""
        slots: list[tuple[int, tuple[str, int | None], float]] = []
        for i, (effect, names) in enumerate(zip(self.effects, self.free, strict=True)):
            for name in names:
                value = getattr(effect, name)
                if isinstance(value, tuple):
                    slots += [(i, (name, k), float(v)) for k, v in enumerate(value)]
                else:
                    slots.append((i, (name, None), float(value)))
        return slots

    def scales(self) -> Floats:
        """A usual size of each of them."""
        sizes = []
        for i, (name, _), value in self.slots():
            usual = self.effects[i].defaults().get(name, 1.0)
            usual = float(np.max(np.abs(usual))) if np.size(usual) else 1.0
            sizes.append(max(abs(value), 0.2 * usual, 1e-9))
        return np.array(sizes)

    def with_values(self, values: Floats) -> "Model":
        """The same with other values of them, held within the effects' limits."""
        effects = list(self.effects)
        for (i, (name, k), _), value in zip(self.slots(), values.tolist(), strict=True):
            said = effects[i].parameters()[name]
            if name == "hour":
                value %= 24.0
            value = min(max(value, said.low), said.high)
            if k is None:
                effects[i] = replace(effects[i], **{name: value})
            else:
                whole = list(getattr(effects[i], name))
                whole[k] = value
                effects[i] = replace(effects[i], **{name: tuple(whole)})
        return replace(self, effects=tuple(effects))

    def linear(self, record: Record, split: Split, coded: Floats | None = None) -> Linear:
        """The model about which candidates are tried; columns of the effects' parameters included.

        `coded`, shape (days, n), is what named events do to the output.
        """
        assert self.noise is not None
        start = self.baseline(record)
        columns = self.jacobian(record, start)
        sd = np.concatenate([[f.sd for f in self.reach.parameters], WIDE * self.scales()])
        off = [f.value - f.mean for f in self.reach.parameters]
        deviation = np.concatenate([off, np.zeros(len(self.values()))])
        residual = residual_of(record, start)
        if coded is not None:
            residual = residual - coded
        return Linear(
            record, split, residual, columns, sd, deviation, self.noise, self.gauge_floor, self.level_noise
        )

    def jacobian(self, record: Record, start: Floats) -> Floats:
        """Columns of all free parameters, shape (p + q, days, n)."""
        columns = [self.reach.slopes(record, start, self.changes(record))]
        values, scales = self.values(), self.scales()
        for j in range(len(values)):
            other = values.copy()
            other[j] += 0.05 * scales[j]
            moved = self.with_values(other)
            step = moved.values()[j] - values[j]
            if abs(step) < 1e-3 * scales[j]:  # at its upper limit: look the other way
                other[j] = values[j] - 0.05 * scales[j]
                moved = self.with_values(other)
                step = moved.values()[j] - values[j]
            columns.append(((moved.baseline(record) - start) / step)[None])
        return np.concatenate(columns)


def calibrate(
    model: Model,
    record: Record,
    *,
    coded: Floats | None = None,
    steps: int = MOST_STEPS,
    trim: float = 0.0,
    report: Callable[[str], None] = lambda _: None,
) -> Model:
    """Fit all free parameters to a record.

    Parameters
    ----------
    model : Model
    record : Record
        The days to fit to, nothing else.
    coded : ndarray, shape (days, n), optional
        What named events do to the output on these days.
    steps : int
        Steps at most.
    trim : float
        Share of the noisiest days that count for nothing: an effect on many days bends the response.
    report : callable
        Told of each step.

    Returns
    -------
    Model
        With the fitted noise.
    """
    model = replace(model, reach=model.reach.settled(record))
    p = len(model.reach.parameters)
    sd = np.concatenate([[f.sd for f in model.reach.parameters], WIDE * model.scales()])
    middle = np.concatenate([[f.mean for f in model.reach.parameters], model.values()])

    def left(of: Model) -> Floats:
        z = residual_of(record, of.baseline(record))
        return np.where(record.used, z if coded is None else z - coded, np.nan)

    def at(of: Model) -> Floats:
        return np.concatenate([vector_of(of.reach), of.values()])

    z = left(model)
    damping = 1e-2
    for step in range(steps):
        noise = fit_noise(
            z, record.sample_time, model.reach.surface_area, level=model.level_noise,
            gauge_floor=model.gauge_floor, starts=() if model.noise is None else (model.noise,),
            alone=model.noise is not None and step > 1,
        )  # fmt: skip
        model = replace(model, noise=noise)
        whitened = noise.whiten(z)
        weights = day_weights(whitened)
        if trim > 0.0:
            weights = np.where(weights < np.quantile(weights, trim), 0.0, weights)
            noise = fit_noise(
                z, record.sample_time, model.reach.surface_area, weights=weights, level=model.level_noise,
                gauge_floor=model.gauge_floor, starts=(noise,), alone=True,
            )  # fmt: skip
            model = replace(model, noise=noise)
            whitened = noise.whiten(z)
        root = np.sqrt(weights)[:, None]
        X = noise.whiten(model.jacobian(record, model.baseline(record)), like=z) * root
        X = X.reshape(len(sd), -1) * sd[:, None]  # in prior standard deviations
        here = at(model)
        off = (here - middle) / sd
        G, g = X @ X.T + np.eye(len(sd)), X @ (whitened * root).ravel() - off
        cost = 0.5 * float(((whitened * root) ** 2).sum() + off @ off)
        fell = 0.0
        for _ in range(TRIES):
            move = np.linalg.solve(G + damping * np.diag(np.diag(G)), g) * sd
            move[:p] = np.clip(move[:p], -2.0 * sd[:p], 2.0 * sd[:p])
            there = here + move
            try:
                other = replace(model, reach=model.reach.with_parameters(there[:p])).with_values(there[p:])
                z_other = left(other)
                w = noise.whiten(z_other) * root
            except RividError:  # a flow that cannot be: a shorter step
                damping *= 8.0
                continue
            off = (at(other) - middle) / sd
            now = 0.5 * float((w**2).sum() + off @ off)
            if now < cost:
                fell = cost - now
                model, z = other, z_other
                damping = max(damping / 6.0, 1e-4)
                break
            damping *= 8.0
        report(f"step {step + 1}: cost {cost:.0f}, less {fell:.1f}")
        if fell < ENOUGH:
            break
    return replace(
        model,
        noise=fit_noise(
            z, record.sample_time, model.reach.surface_area, level=model.level_noise,
            gauge_floor=model.gauge_floor, starts=() if model.noise is None else (model.noise,),
        ),
    )  # fmt: skip
