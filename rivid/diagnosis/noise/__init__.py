"""The noise of a simulated reach, for those who use it: the model, its fit, and the weights of days."""

from rivid.diagnosis.noise.fit import DAY_LIMIT, day_weights, fit_noise
from rivid.diagnosis.noise.model import NoiseModel, Smoothed
from rivid.diagnosis.noise.starts import WALK_LIMIT

__all__ = ["DAY_LIMIT", "WALK_LIMIT", "NoiseModel", "Smoothed", "day_weights", "fit_noise"]
