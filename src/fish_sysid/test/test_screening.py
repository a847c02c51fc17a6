# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Every effect is found from the place and the strength from which it can be."""

from dataclasses import replace

import numpy as np
import pytest
from swims import GIVEN, fish, swim

from fish_sim.robot import Robot
from fish_sysid.dataset.synthetic import program, record
from fish_sysid.diagnosis import screening
from fish_sysid.diagnosis.pipeline import fit_nominal
from fish_sysid.diagnosis.task import make_task
from fish_sysid.estimation.ekf_types import Noise
from fish_sysid.estimation.map_fit import climb, evaluate
from fish_sysid.estimation.parametrization import nominal_hypothesis
from fish_sysid.estimation.refit import alternate
from fish_sysid.estimation.thresholds import POLISH_ITERATIONS


@pytest.mark.parametrize(
    ("robot", "name", "key", "hidden", "near", "place"),
    [
        (
            GIVEN,
            "sloshing",
            "frequency",
            {"sine": -0.02, "cosine": 0.01, "frequency": 0.77},
            0.8,
            screening.place_near,
        ),
        (
            GIVEN,
            "wave_drag",
            "speed",
            {"amplitude": 0.03, "speed": 0.13, "width": 0.03},
            0.12,
            screening.place_far,
        ),
        (Robot(), "rudder_saturation", "limit", {"limit": 0.11}, 0.13, screening.place_near),
        (Robot(), "rudder_saturation", "limit", {"limit": 0.11}, 0.13, screening.place_far),
    ],
)
def test_an_effect_is_found_from_the_place_that_promises_most(
    robot, name, key, hidden, near, place
):
    """From a single start value, no step leads there."""
    random = np.random.default_rng(4)
    commands = np.stack([program(kind, 7.0, random) for kind in ("sines", "straight")], axis=1)
    experiment = record(robot.with_effect(name, **hidden), commands, Noise(), random)[0]
    drags = nominal_hypothesis(robot, ("head_drag_surge", "head_drag_sway"))
    base = alternate(evaluate(drags, np.zeros(2), experiment, Noise()), experiment)
    assert screening.best_place(base, name, experiment, base.noise)[key] == pytest.approx(near)
    fit = alternate(place(base, name, experiment), experiment)
    assert fit.values[f"{name}.{key}"] == pytest.approx(hidden[key], rel=0.1)


@pytest.mark.parametrize("below", [0.95, 0.5, 0.25])
def test_a_rotor_that_is_limited_is_found_without_its_encoder(below):
    """No step leads down from a limit that no command reaches, though it is nearer to the truth than the others."""
    random = np.random.default_rng(1)
    commands = np.stack(
        [program(kind, 6.0, random) for kind in ("steps", "sines", "random")], axis=1
    )
    limit = below * np.abs(commands[..., 0]).max()
    seen = record(GIVEN.with_effect("rotor_saturation", limit=limit), commands, Noise(), random)[0]
    experiment = replace(seen, encoder=np.full_like(seen.encoder, np.nan))
    drags = nominal_hypothesis(GIVEN, ("head_drag_surge", "head_drag_sway"))
    base = alternate(evaluate(drags, np.zeros(2), experiment, Noise()), experiment)
    fit = alternate(screening.place_far(base, "rotor_saturation", experiment), experiment)
    assert fit.values["rotor_saturation.limit"] == pytest.approx(limit, rel=0.01)


@pytest.mark.parametrize("place_candidate", [screening.place_near, screening.place_far])
def test_a_hump_of_drag_is_not_lost_while_it_is_weak(place_candidate):
    """A step of its speed and width, which seem free while it is weak, leads a weak hump to where the fish never swims."""
    random = np.random.default_rng(9)
    commands = np.stack(
        [program(kind, 8.0, random) for kind in ("sines", "straight", "random")], axis=1
    )
    place = {"speed": 0.145, "width": 0.035}
    hump = Robot().with_effect("wave_drag", amplitude=0.02, **place)
    experiment = record(hump, commands, Noise(), random)[0]
    nominal = nominal_hypothesis(Robot())
    base = alternate(
        evaluate(nominal, np.zeros(len(nominal.free)), experiment, Noise()), experiment
    )
    fit = climb(place_candidate(base, "wave_drag", experiment), experiment, POLISH_ITERATIONS)
    truth = screening.started(base, "wave_drag", 1.0, place)
    best = climb(evaluate(fit.hypothesis, truth, experiment, base.noise), experiment, 20)
    assert fit.log_posterior > best.log_posterior - 3.0 > base.log_posterior + 15.0


def test_images_half_a_second_old_are_found():
    """A stroke is half a second: the heading fits again without a delay."""
    random = np.random.default_rng(6)
    commands = np.stack(
        [program(kind, 8.0, random) for kind in ("sines", "steps", "random")], axis=1
    )
    experiment = record(GIVEN, commands, Noise(), random)[0]
    late = replace(experiment, frames=tuple(replace(f, t=f.t + 0.47) for f in experiment.frames))
    drags = nominal_hypothesis(GIVEN, ("head_drag_surge", "head_drag_yaw", "fin_drag_sway"))
    base = alternate(evaluate(drags, np.zeros(3), late, Noise()), late)
    fit = alternate(screening.place_far(base, "camera_latency", late), late)
    assert fit.values["camera_latency.delay"] == pytest.approx(0.47, abs=0.005)


def test_an_effect_far_weaker_than_typical_is_found_where_little_is_left():
    """From a typical strength, which the data refuse by tens of thousands of nats, no step leads back to a weak one."""
    random = np.random.default_rng(8)
    commands = np.stack(
        [program(kind, 12.0, random) for kind in ("sines", "steps", "random")], axis=1
    )
    weak = GIVEN.with_effect("tail_hardening", k3=0.036)
    experiment = record(weak, commands, Noise(), random)[0]
    free = nominal_hypothesis(GIVEN, ("tail_stiffness", "fin_drag_sway"))
    base = alternate(evaluate(free, np.zeros(2), experiment, Noise()), experiment)
    fit = screening.place_near(base, "tail_hardening", experiment)
    assert screening.promise(fit) > base.log_posterior + 100.0
    assert alternate(fit, experiment).values["tail_hardening.k3"] == pytest.approx(0.036, rel=0.05)


def test_a_large_effect_of_the_base_is_held_while_screening_and_free_at_the_end():
    """For speed; what it absorbs of a candidate is not in the candidate's gain."""
    random = np.random.default_rng(5)
    commands = np.stack([program(kind, 8.0, random) for kind in ("sines", "steps")], axis=1)
    truth = GIVEN.with_effect("nonuniform_current", gyre_11=0.03, shear_x=0.02)
    truth = truth.with_effect("rudder_offset", offset=0.08)
    experiment = record(truth, commands, Noise(), random)[0]
    drags = nominal_hypothesis(GIVEN, ("head_drag_surge", "head_drag_yaw"))
    flow = drags.with_effect("nonuniform_current")
    base = alternate(evaluate(flow, np.zeros(len(flow.free)), experiment, Noise()), experiment)
    held = screening.hold_large(base, experiment)
    assert held.hypothesis.free == drags.free
    assert held.log_posterior == pytest.approx(base.log_posterior, abs=100.0)
    assert held.robot == base.robot
    task = make_task(experiment, GIVEN)
    first = screening.screen(base, ["rudder_offset"], task)[0]
    assert first.gain > 50.0
    assert len(first.theta) == len(base.theta) + 1
    offset = base.hypothesis.with_effect("rudder_offset").parametrization.decode(first.theta)[-1]
    assert offset == pytest.approx(0.08, abs=0.02)


def test_a_rudder_offset_is_found_in_straight_swims():
    """Nothing is steered, and the fish circles."""
    data = swim(fish(3, rudder_offset={"offset": 0.08}), kinds=("straight",), duration=3.0)
    names = ("rudder_offset", "camera_scale")
    task = make_task(data, Robot(), names=names)
    gains = {one.name: one.gain for one in screening.screen(fit_nominal(task), names, task)}
    assert gains["rudder_offset"] > gains["camera_scale"] + 100.0
