# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What a fit gains on unseen trials: exact where all is linear, and an open parameter costs nothing."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import multivariate_normal
from swims import fish, swim

from fish_sysid.diagnosis.cross_validation import gain_left_out, gain_unseen, on_all, predicted
from fish_sysid.estimation.ekf_types import Noise
from fish_sysid.estimation.map_fit import climb, evaluate
from fish_sysid.estimation.parametrization import nominal_hypothesis
from fish_sysid.estimation.thresholds import NEAR_GAIN, OPEN_GATE

PRIOR = np.array([0.5, 4.0])
LINEAR = SimpleNamespace(parametrization=SimpleNamespace(prior=PRIOR))


def regression(x, y, used=(0, 1)):
    """The fit of y = x theta + unit noise at its optimum; a parameter that is not used stays 0. x: (trials, samples, 2)."""
    x = x * np.isin((0, 1), used)
    theta = np.linalg.solve(
        np.einsum("tsi,tsj->ij", x, x) + np.diag(PRIOR**-2), np.einsum("tsi,ts->i", x, y)
    )
    left = y - x @ theta
    result = SimpleNamespace(
        gradient=-np.einsum("ts,tsi->ti", left, x),
        normal=np.einsum("tsi,tsj->tij", x, x),
        whitened=left.T[..., None],
    )
    likelihood = -0.5 * np.sum(left**2 + np.log(2 * np.pi), axis=1)
    return SimpleNamespace(hypothesis=LINEAR, theta=theta, log_likelihood=likelihood, result=result)


def exact(x, y, held):
    """log p(y of the trials held | y of the others) of jointly Gaussian measurements."""
    others = [i for i in range(len(x)) if i not in held]

    def log_p(trials):
        rows = x[trials].reshape(-1, 2)
        covariance = rows @ np.diag(PRIOR**2) @ rows.T + np.eye(len(rows))
        return multivariate_normal.logpdf(y[trials].ravel(), cov=covariance)

    return log_p([*others, *held]) - log_p(others)


@pytest.mark.parametrize("held", [[0], [1, 3]])
def test_it_is_the_predictive_density_where_all_is_linear(held):
    random = np.random.default_rng(1)
    x = random.standard_normal((4, 10, 2))
    y = x @ np.array([0.3, -2.0]) + random.standard_normal((4, 10))
    assert predicted(regression(x, y), held) == pytest.approx(exact(x, y, held), abs=1e-6)


def test_a_fit_loses_nothing_by_what_only_the_unseen_trials_determine_but_by_a_contradiction():
    random = np.random.default_rng(2)
    x, noise = random.standard_normal((4, 30, 2)), random.standard_normal((4, 30))
    x[:3, :, 1] = 0.0  # only the last trial determines the second parameter
    y = x @ np.array([0.3, 2.0]) + noise
    gain, expected = gain_unseen(regression(x, y, (0,)), regression(x, y), [3])
    assert gain > 0.5 * expected > 10.0
    x = random.standard_normal((4, 30, 2))
    y = x @ np.array([0.3, 2.0]) + noise
    assert gain_left_out(regression(x, y, (0,)), regression(x, y))[0] > 100.0
    y[3] = x[3] @ np.array([0.3, -2.0]) + noise[3]  # the others determine it, and it is wrong here
    assert gain_unseen(regression(x, y, (0,)), regression(x, y), [3])[0] < -10.0


def test_a_fit_reaches_the_optimum_of_all_trials_with_every_measurement_counted():
    flow = {"shear_x": 0.2, "gyre_11": 0.1, "gyre_21": -0.08, "gyre_22": 0.06}
    training = swim(fish(nonuniform_current=flow), kinds=("sines", "turn"))
    hypothesis = nominal_hypothesis(fish()).with_effect("nonuniform_current")
    origin = hypothesis.parametrization.origin()
    far = evaluate(hypothesis, origin, training.select([0]), Noise())
    near = on_all(far, training)
    assert climb(near, training, 10).log_posterior - near.log_posterior < NEAR_GAIN
    assert near.noise.gate_imu == near.noise.gate_camera == OPEN_GATE
