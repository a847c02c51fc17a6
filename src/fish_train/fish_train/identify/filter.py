"""One pass of the filter over an experiment: compiled where possible, else in NumPy."""

from __future__ import annotations

from fish_sim.step import Stepper
from fish_train.identify.experiment import Experiment
from fish_train.identify.filter_compiled import compiled_pass
from fish_train.identify.filter_numpy import Filter
from fish_train.identify.filter_types import Array, FilterResult, Noise, SensorModel


def run_filter(
    experiment: Experiment,
    stepper: Stepper,
    p: Array,
    dp: Array,
    sensors: SensorModel,
    noise: Noise,
    keep: bool = False,
) -> FilterResult:
    """Innovations, likelihood, score and Gauss-Newton matrix of all trials.

    p (NP,): parameters of the stepper, which must have the effect `disturbance`; dp (K, NP): their derivatives with
    respect to the free parameters; keep: store what the smoother needs.
    """
    result = compiled_pass(experiment, stepper, p, dp, sensors, noise, keep)
    return result or Filter(experiment, stepper, p, dp, sensors, noise).run(keep)
