"""Effects chosen by predictions of trials left out: the hidden one, and none where none is."""

from __future__ import annotations

import numpy as np
import pytest

from fish_sim.robot import Robot
from fish_sysid.dataset.synthetic import program, record
from fish_sysid.estimation.effect_selection import choose_effects
from fish_sysid.estimation.ekf_types import Noise
from fish_sysid.estimation.map_fit import Fit, evaluate
from fish_sysid.estimation.parametrization import nominal_hypothesis

NAMES, NOISE = ("rudder_gain", "rotor_imbalance"), Noise(wrench=(0.002, 0.004, 1e-4))


def fit_of(robot: Robot, trials: int = 8) -> tuple[Fit, object]:
    random = np.random.default_rng(7)
    kinds = [("sines", "random", "steps")[m % 3] for m in range(trials)]
    commands = np.stack([program(kind, 7.0, random) for kind in kinds], axis=1)
    experiment = record(robot, commands, NOISE, random)[0]
    return evaluate(
        nominal_hypothesis(Robot(), ("head_drag_yaw",)), np.zeros(1), experiment, NOISE
    ), experiment


def test_the_hidden_effect_is_added_and_no_other() -> None:
    fit, experiment = fit_of(Robot().with_effect("rudder_gain", factor=0.7))
    found, steps = choose_effects(fit, experiment, NAMES)
    assert found.hypothesis.names == ("rudder_gain",)
    assert found.values["rudder_gain.factor"] == pytest.approx(0.7, abs=0.05)
    assert [s.name for s in steps if s.added] == ["rudder_gain"]
    assert (
        next(s for s in steps if s.added).gain > 3.0 * next(s for s in steps if s.added).deviation
    )


def test_nothing_is_added_where_nothing_is_missing_or_too_few_trials_are_there() -> None:
    fit, experiment = fit_of(Robot())
    assert choose_effects(fit, experiment, NAMES)[0].hypothesis.names == ()
    assert choose_effects(fit, experiment.select(range(4)), NAMES) == (fit, ())
