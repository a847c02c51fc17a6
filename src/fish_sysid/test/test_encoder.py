# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The encoder's part of the likelihood: Gaussian inside the gate, indifferent beyond, its noise told by the median."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import norm

from fish_sim.robot import Robot
from fish_sysid.dataset.synthetic import program, record
from fish_sysid.estimation.ekf_types import Noise, encoder_terms
from fish_sysid.estimation.map_fit import evaluate
from fish_sysid.estimation.noise_estimation import commanded_residual, encoder_noise, estimate_noise
from fish_sysid.estimation.parametrization import nominal_hypothesis


@pytest.fixture(scope="module")
def swum():
    random = np.random.default_rng(3)
    commands = np.stack([program(kind, 4.0, random) for kind in ("sines", "steps")], axis=1)
    return record(Robot(), commands, Noise(), random)[0]


def test_log_likelihood_gradient_and_gate(swum):
    rotor, d_rotor = commanded_residual(swum), np.ones((*swum.encoder.shape, 1))
    model = swum.encoder - rotor
    terms = encoder_terms(swum, Noise(), model, d_rotor)
    assert terms.log_likelihood == pytest.approx(norm.logpdf(rotor, scale=0.15).sum(0), rel=1e-12)
    assert terms.gradient[:, 0] == pytest.approx(-rotor.sum(0) / 0.15**2, rel=1e-9)
    assert terms.normal[:, 0, 0] == pytest.approx(terms.samples / 0.15**2)
    wrong = swum.encoder.copy()
    wrong[100, 0] = np.nan
    missing = encoder_terms(replace(swum, encoder=wrong), Noise(), model, d_rotor)
    wrong[100, 0] = 80.0
    far = encoder_terms(replace(swum, encoder=wrong), Noise(), model, d_rotor)
    wrong[100, 0] = 40.0
    near = encoder_terms(replace(swum, encoder=wrong), Noise(), model, d_rotor)
    assert far.log_likelihood == pytest.approx(near.log_likelihood)
    assert far.gradient == pytest.approx(missing.gradient)
    assert far.normal == pytest.approx(missing.normal)
    assert list(far.samples - missing.samples) == [1, 0]


def test_noise_is_not_that_of_a_few_wild_samples(swum):
    wild = swum.encoder.copy()
    wild[::40] += 60.0
    residual = commanded_residual(replace(swum, encoder=wild))
    assert encoder_noise(residual, 0.15) == pytest.approx(0.15, rel=0.12)
    assert encoder_noise(np.full(5, np.nan), 0.15) == 0.15


def test_an_encoder_worse_than_said_is_noticed_by_the_fit(swum):
    random = np.random.default_rng(4)
    rough = replace(swum, encoder=swum.encoder + 1.5 * random.standard_normal(swum.encoder.shape))
    fit = evaluate(nominal_hypothesis(Robot(), ()), np.zeros(0), rough, Noise())
    assert estimate_noise(fit, rough).encoder == pytest.approx(1.507, rel=0.1)  # with its own 0.15
