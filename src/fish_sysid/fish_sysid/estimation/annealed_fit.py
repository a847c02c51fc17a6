"""A cold fit that finds the right optimum: the IMU is believed little at first and more and more.

With the accelerometer's and gyro's full weight the likelihood has many optima, because a wrong phase of the tail's swing is
as bad as no swing at all. With their standard deviations a hundred times as large the camera leads, and the nominal values
lead to the optimum from 30 % away where the tail has few links; each further stage starts from the one before.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fish_report.parallel import on_all_cores
from fish_sysid.dataset.experiment import Experiment
from fish_sysid.estimation.ekf_types import Noise
from fish_sysid.estimation.initial_noise import STRANGE, open_gates, worst_row
from fish_sysid.estimation.map_fit import (
    Fit,
    climb,
    evaluate,
    log_posterior,
)
from fish_sysid.estimation.noise_estimation import (
    NOISE_MOVES,
    SENSOR_MOVES,
    Reach,
    adapt_noise,
)
from fish_sysid.estimation.parametrization import Coordinates, Hypothesis

Array = NDArray[np.float64]
Report = Callable[[str], None]
Stages = tuple[tuple[float, int], ...]

# factor of the IMU's noise, iterations: first the camera leads
LEADING: Stages = ((100.0, 25), (30.0, 25), (10.0, 15))
CLOSING: Stages = ((3.0, 15), (1.0, 15))
# the tail's: far from the optimum they imitate a wrong phase of its swing
TAIL_INERTIAS = ("link_inertia_factor", "fin_inertia_factor")
HELD_AT = (0.0, 0.25, -0.25)  # of theta
FAR_GAIN = 3.0  # nats; an iteration of a stage that is not the last and gains less is its last
ROUNDS = 2  # of noise estimation and refits


def fit_tempered(
    hypothesis: Hypothesis,
    experiment: Experiment,
    noise: Noise,
    theta: Array | None = None,
    report: Report = lambda _: None,
    held: tuple[str, ...] = (),
) -> Fit:
    """Fit from `theta` (default: the hypothesis's start values), then estimate the process noise, in turn.

    The parameters `held` are free only at the IMU's full weight; before, the camera leads the others with these at several
    values, and the best goes on.
    """
    report("fitting, the camera leads")
    theta = Coordinates(hypothesis).origin() if theta is None else theta
    held = tuple(name for name in held if name in hypothesis.free)
    places = [_with(hypothesis, theta, held, value) for value in (HELD_AT if held else (0.0,))]
    leads = on_all_cores(
        lambda place: lead(hypothesis, experiment, noise, place, held=held), places
    )
    return close(max(leads, key=lambda fit: fit.objective), experiment, noise, report, held)


def lead(
    hypothesis: Hypothesis,
    experiment: Experiment,
    noise: Noise,
    theta: Array,
    stages: Stages = LEADING,
    held: tuple[str, ...] = (),
) -> Fit:
    """Where stages of falling IMU noise lead all but `held` from theta, gates open; it ends at what noise cannot explain."""
    theta = theta.copy()
    first = [i for i, name in enumerate(hypothesis.free) if name not in held]
    coarse = hypothesis.fixing(held, theta)
    for factor, iterations in stages:
        wide = replace(open_gates(noise), gyro=factor * noise.gyro, accel=factor * noise.accel)
        fit = climb(
            evaluate(coarse, theta[first], experiment, wide), experiment, iterations, FAR_GAIN
        )
        theta[first] = fit.theta
        if worst_row(fit) > STRANGE:
            break
    return evaluate(hypothesis, theta, experiment, wide) if held else fit


def _with(hypothesis: Hypothesis, theta: Array, names: tuple[str, ...], value: float) -> Array:
    """Theta with some of its entries moved by `value`."""
    moved = theta.copy()
    moved[[hypothesis.free.index(name) for name in names]] += value
    return moved


def close(
    fit: Fit,
    experiment: Experiment,
    noise: Noise,
    report: Report = lambda _: None,
    held: tuple[str, ...] = (),
) -> Fit:
    """From where the camera led to the IMU's full weight, then process noise and parameters in turn.

    Where a stage leaves innovations that the sensors' noise cannot explain, either it or the model is wrong: both are tried,
    that noise estimated as well and left alone, and the likelier goes on. The last steps leave out outliers by the gates of
    `noise`.
    """
    hypothesis = fit.hypothesis
    if worst_row(fit) <= STRANGE:
        report("fitting, the IMU is believed more and more")
        fit = lead(hypothesis, experiment, noise, fit.theta, CLOSING, held)
    found = [_fit_with_sensor_noise(fit, experiment, report)] if worst_row(fit) > STRANGE else []
    fit = climb(evaluate(hypothesis, fit.theta, experiment, noise), experiment, CLOSING[-1][1])
    for _ in range(ROUNDS):
        report("fitting, process noise")
        adapted = replace(
            adapt_noise(fit, experiment, reach=Reach.COLD),
            gate_camera=noise.gate_camera,
            gate_imu=noise.gate_imu,
        )
        fit = climb(evaluate(hypothesis, fit.theta, experiment, adapted), experiment, 8)

    def without_gates(way: Fit) -> float:
        """Behind gates a filter that has lost the fish would leave most of the evidence against it out."""
        return log_posterior(hypothesis, way.theta, experiment, open_gates(way.noise))

    return max((fit, *found), key=without_gates) if found else fit


def _fit_with_sensor_noise(fit: Fit, experiment: Experiment, report: Report) -> Fit:
    """Alternate between all noise and parameters, gates open."""
    for _ in range(ROUNDS + 1):
        report("fitting, noise of sensors and process")
        adapted = adapt_noise(fit, experiment, 2, (*SENSOR_MOVES, *NOISE_MOVES), Reach.COLD)
        fit = climb(evaluate(fit.hypothesis, fit.theta, experiment, adapted), experiment, 8)
    return fit
