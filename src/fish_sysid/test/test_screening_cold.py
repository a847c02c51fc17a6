"""From a base that is far from the truth the right name is found where the camera leads."""

from dataclasses import replace

import numpy as np
import pytest

from fish_sim.robot import Robot
from fish_sysid.dataset.synthetic import program, record
from fish_sysid.diagnosis import screening, screening_cold
from fish_sysid.estimation.ekf_types import Noise
from fish_sysid.estimation.global_fit import TOO_STRONG, excess
from fish_sysid.estimation.map_fit import evaluate
from fish_sysid.estimation.parametrization import nominal_hypothesis

NAMES = ("rudder_gain", "rudder_delay", "rudder_lag", "current", "tail_hardening")


@pytest.fixture(scope="module")
def late():
    """A rudder that is late, and a base that makes up for it with wrong parameters and a strong force."""
    random = np.random.default_rng(3)
    commands = np.stack(
        [program(kind, 8.0, random) for kind in ("sines", "steps", "random")], axis=1
    )
    experiment = record(Robot().with_effect("rudder_delay", delay=0.09), commands, Noise(), random)[
        0
    ]
    hypothesis = nominal_hypothesis(
        Robot(), ("head_added_mass_sway", "link_drag_sway", "tail_stiffness")
    )
    strong = replace(Noise(), wrench=tuple(10.0 * w for w in Noise().wrench))
    base = evaluate(hypothesis, np.array([2.0, 1.5, 1.0]), experiment, strong)
    assert excess(base).max() > TOO_STRONG
    return base, experiment


def test_the_right_name_is_far_ahead_and_its_size_known(late):
    base, experiment = late
    said = []
    ranked = screening_cold.rank_afar(base, NAMES, experiment, said.append)
    assert ranked[0].name == "rudder_delay"
    assert ranked[0].gain > 1.5 * max(1000.0, ranked[1].gain)
    fit = evaluate(
        base.hypothesis.with_effect("rudder_delay", screening.SCALE),
        ranked[0].theta,
        experiment,
        Noise(),
    )
    assert fit.values["rudder_delay.delay"] == pytest.approx(0.09, abs=0.005)
    assert fit.values["tail_stiffness"] == pytest.approx(
        Robot().parameters["tail_stiffness"], rel=0.2
    )
    assert {r.name for r in ranked} == set(NAMES)
    assert any(text == f"ranking current (4 of {len(NAMES)})" for text in said)


def test_all_are_compared_at_one_noise_wherever_the_camera_stopped_to_lead(late, monkeypatch):
    """Innovations that no sensor explains end a lead early, at a noise where anything fits."""
    base, experiment = late
    monkeypatch.setattr("fish_sysid.estimation.annealed_fit.STRANGE", 0.0)
    short = screening.shorten(experiment, 300)
    noise = screening_cold.usual_noise(short)
    fit = screening_cold.led(base.hypothesis, base.theta, short, noise, screening_cold.STAGES)
    assert fit.noise.gyro == pytest.approx(screening_cold.STAGES[-1][0] * noise.gyro)
