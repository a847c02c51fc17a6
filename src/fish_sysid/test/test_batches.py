"""Trials go through a few at a time where a pass holds much of every step, to the same result."""

from dataclasses import replace

import numpy as np
import pytest

from fish_sim.robot import Robot
from fish_sysid.dataset.experiment import Experiment
from fish_sysid.dataset.synthetic import program, record
from fish_sysid.diagnosis import batches, latent_force, residual_regression
from fish_sysid.estimation.ekf_types import Noise
from fish_sysid.estimation.map_fit import Fit, evaluate
from fish_sysid.estimation.parametrization import nominal_hypothesis

LENGTH = 200
STEPS = (LENGTH, 120, 150, LENGTH, 90)


@pytest.fixture(scope="module")
def swum() -> tuple[Fit, Experiment]:
    """A fit of five trials of uneven length."""
    random = np.random.default_rng(2)
    kinds = ("sines", "steps", "random", "sines", "turn")
    commands = np.stack([program(kind, 0.01 * LENGTH, random) for kind in kinds], axis=1)
    fish = record(Robot().with_effect("current", x=0.03), commands, Noise(), random)[0]
    seen = [frames.t < 0.01 * steps for frames, steps in zip(fish.frames, STEPS, strict=True)]
    frames = tuple(
        replace(f, t=f.t[s], pose=f.pose[s]) for f, s in zip(fish.frames, seen, strict=True)
    )
    fish = replace(fish, steps=np.array(STEPS), frames=frames)
    nominal = nominal_hypothesis(Robot())
    return evaluate(nominal, np.zeros(len(nominal.free)), fish, Noise()), fish


@pytest.mark.parametrize(
    ("at_once", "expected"),
    [
        (10 * LENGTH, [[0, 1, 2, 3, 4]]),
        (2 * LENGTH + 9, [[0, 1], [2, 3], [4]]),
        (1, [[0], [1], [2], [3], [4]]),
    ],
)
def test_a_portion_has_so_many_steps_and_one_trial_at_least(monkeypatch, swum, at_once, expected):
    monkeypatch.setattr(batches, "STEPS_AT_ONCE", at_once)
    assert batches.portions(swum[1]) == expected


def test_a_law_and_the_missing_force_are_the_same_in_portions_of_which_none_is_large(
    monkeypatch, swum
):
    fit, fish = swum
    whole, force = residual_regression.describe(fit, fish), latent_force.missing_force(fit, fish)
    passed = []

    def watched(hypothesis, theta, experiment, *others, **options):
        passed.append(len(experiment.names))
        return evaluate(hypothesis, theta, experiment, *others, **options)

    monkeypatch.setattr(batches, "STEPS_AT_ONCE", 2 * LENGTH)
    for module in (residual_regression, latent_force):
        monkeypatch.setattr(module, "evaluate", watched)
    again, in_portions = (
        residual_regression.describe(fit, fish),
        latent_force.missing_force(fit, fish),
    )
    assert passed == [2, 2, 1] * 2
    assert again.terms.keys() == whole.terms.keys()
    assert again.gain == pytest.approx(whole.gain, rel=1e-9)
    np.testing.assert_allclose(in_portions.wrench, force.wrench, rtol=1e-9, atol=1e-12)
    for name, values in force.covariates.items():
        np.testing.assert_allclose(in_portions.covariates[name], values, rtol=1e-9, atol=1e-12)
    assert np.isfinite(force.wrench[..., 0]).sum(axis=0).tolist() == list(STEPS)
