"""A law of the remaining force: what it would gain, against dense matrices, and nothing where there is none."""

import numpy as np
import pytest

from fish_sim.model import DT
from fish_train.diagnose.law import describe, prior_cost
from fish_train.diagnose.locate import MissingForce
from fish_train.identify.filter_types import Noise

NOISE = Noise(wrench=(0.004, 0.008, 2e-4), wrench_time=0.2)
COVARIATES = ("surge_speed", "sway_speed", "yaw_rate", "rudder", "heading", "wall_distance", "x", "y", "time")
STEPS, TRIALS = 2000, 5


def water(random: np.random.Generator, deviation: float) -> np.ndarray:
    """(STEPS, TRIALS) of the process that the filter assumes."""
    decay, w = np.exp(-DT / NOISE.wrench_time), np.zeros((STEPS, TRIALS))
    shocks = deviation * np.sqrt(1.0 - decay**2) * random.standard_normal((STEPS, TRIALS))
    for k in range(1, STEPS):
        w[k] = decay * w[k - 1] + shocks[k]
    return w


def slow(random: np.random.Generator) -> np.ndarray:
    """A covariate that wanders as a fish does."""
    t, phase = DT * np.arange(STEPS)[:, None], random.uniform(0.0, 6.3, (2, TRIALS))
    return np.sin(0.8 * t + phase[0]) + 0.5 * np.sin(2.1 * t + phase[1])


def remaining(seed: int, yaw_law: float) -> MissingForce:
    random = np.random.default_rng(seed)
    c = {name: slow(random) for name in COVARIATES}
    wrench = np.stack([water(random, d) for d in NOISE.wrench], axis=2)
    wrench[..., 2] += yaw_law * np.cos(c["heading"])
    return MissingForce(tuple("abcde"), wrench, np.ones_like(wrench), c)


def test_the_cost_of_a_wrench_is_that_of_its_dense_covariance():
    t = DT * np.arange(60)
    covariance = 0.3**2 * np.exp(-np.abs(t[:, None] - t) / NOISE.wrench_time)
    w = np.random.default_rng(1).standard_normal(60)
    assert prior_cost(w, 0.3, NOISE) == pytest.approx(0.5 * w @ np.linalg.solve(covariance, w))


def test_a_law_gains_what_it_explains_and_water_nothing():
    there, nothing = (describe(remaining(2, size), NOISE) for size in (4e-4, 0.0))
    assert "cos(heading)" in there.terms["yaw"]
    assert there.terms["yaw"]["cos(heading)"] == pytest.approx(4e-4, rel=0.3)
    assert there.gain["yaw"] > 50.0 > 0.0 > nothing.gain["yaw"]
    assert max(nothing.gain.values()) < 0.0 and max(there.gain["surge"], there.gain["sway"]) < 0.0
