"""Every effect is found from the place and at the strength from which it can be, also beside one of many numbers."""

from dataclasses import replace

import numpy as np
import pytest

from fish_sim.robot import Robot
from fish_sysid.dataset.synthetic import program, record
from fish_sysid.diagnosis import screening
from fish_sysid.estimation.ekf_types import Noise
from fish_sysid.estimation.map_fit import climb, evaluate
from fish_sysid.estimation.noise_estimation import settle
from fish_sysid.estimation.parametrization import nominal_hypothesis


@pytest.mark.parametrize(
    ("name", "key", "hidden", "near", "look"),
    [
        (
            "sloshing",
            "frequency",
            {"sine": -0.02, "cosine": 0.01, "frequency": 0.77},
            0.8,
            screening.look_near,
        ),
        (
            "wave_drag",
            "speed",
            {"amplitude": 0.03, "speed": 0.13, "width": 0.03},
            0.12,
            screening.look_afar,
        ),
        ("rudder_saturation", "limit", {"limit": 0.11}, 0.13, screening.look_near),
        ("rudder_saturation", "limit", {"limit": 0.11}, 0.13, screening.look_afar),
    ],
)
def test_an_effect_is_found_from_the_place_that_promises_most(name, key, hidden, near, look):
    """From the one start value that both had before, a search does not walk there."""
    random = np.random.default_rng(4)
    commands = np.stack([program(kind, 7.0, random) for kind in ("sines", "straight")], axis=1)
    experiment = record(Robot().with_effect(name, **hidden), commands, Noise(), random)[0]
    drags = nominal_hypothesis(Robot(), ("head_drag_surge", "head_drag_sway"))
    base = settle(evaluate(drags, np.zeros(2), experiment, Noise()), experiment)
    assert screening.best_place(base, name, experiment, base.noise)[key] == pytest.approx(near)
    fit = settle(look(base, name, experiment), experiment)
    assert fit.values[f"{name}.{key}"] == pytest.approx(hidden[key], rel=0.1)


@pytest.mark.parametrize("below", [0.95, 0.5, 0.25])
def test_a_rotor_that_is_limited_is_found_without_its_encoder(below):
    """No step leads down from a limit that no command reaches, though it is nearer to the truth than any other that is tried."""
    random = np.random.default_rng(1)
    commands = np.stack(
        [program(kind, 6.0, random) for kind in ("steps", "sines", "random")], axis=1
    )
    limit = below * np.abs(commands[..., 0]).max()
    seen = record(Robot().with_effect("rotor_saturation", limit=limit), commands, Noise(), random)[
        0
    ]
    experiment = replace(seen, encoder=np.full_like(seen.encoder, np.nan))
    drags = nominal_hypothesis(Robot(), ("head_drag_surge", "head_drag_sway"))
    base = settle(evaluate(drags, np.zeros(2), experiment, Noise()), experiment)
    fit = settle(screening.look_afar(base, "rotor_saturation", experiment), experiment)
    assert fit.values["rotor_saturation.limit"] == pytest.approx(limit, rel=0.01)


@pytest.mark.parametrize("look", [screening.look_near, screening.look_afar])
def test_a_hump_of_drag_is_not_lost_while_it_is_weak(look):
    """A step of its speed and width, which seem free while it is weak, leads a weak hump to where the fish never swims."""
    random = np.random.default_rng(9)
    commands = np.stack(
        [program(kind, 8.0, random) for kind in ("sines", "straight", "random")], axis=1
    )
    place = {"speed": 0.145, "width": 0.035}
    hump = Robot().with_effect("wave_drag", amplitude=0.02, **place)
    experiment = record(hump, commands, Noise(), random)[0]
    nominal = nominal_hypothesis(Robot())
    base = settle(evaluate(nominal, np.zeros(len(nominal.free)), experiment, Noise()), experiment)
    fit = climb(look(base, "wave_drag", experiment), experiment, screening.POLISH_ITERATIONS)
    truth = screening.started(base, "wave_drag", 1.0, place)
    best = climb(evaluate(fit.hypothesis, truth, experiment, base.noise), experiment, 20)
    assert fit.objective > best.objective - 3.0 > base.objective + 15.0


def test_images_half_a_second_old_are_found():
    """A stroke is half a second: the heading fits again without a delay."""
    random = np.random.default_rng(6)
    commands = np.stack(
        [program(kind, 8.0, random) for kind in ("sines", "steps", "random")], axis=1
    )
    experiment = record(Robot(), commands, Noise(), random)[0]
    late = replace(experiment, frames=tuple(replace(f, t=f.t + 0.47) for f in experiment.frames))
    drags = nominal_hypothesis(Robot(), ("head_drag_surge", "head_drag_yaw", "fin_drag_sway"))
    base = settle(evaluate(drags, np.zeros(3), late, Noise()), late)
    fit = settle(screening.look_afar(base, "camera_latency", late), late)
    assert fit.values["camera_latency.delay"] == pytest.approx(0.47, abs=0.005)


def test_an_effect_far_weaker_than_typical_is_found_where_little_is_left():
    """From a typical strength, which the data refuse by tens of thousands of nats, no step leads back to a weak one."""
    random = np.random.default_rng(8)
    commands = np.stack(
        [program(kind, 12.0, random) for kind in ("sines", "steps", "random")], axis=1
    )
    weak = Robot().with_effect("tail_hardening", k3=0.036)
    experiment = record(weak, commands, Noise(), random)[0]
    free = nominal_hypothesis(Robot(), ("tail_stiffness", "fin_drag_sway"))
    base = settle(evaluate(free, np.zeros(2), experiment, Noise()), experiment)
    fit = screening.look_near(base, "tail_hardening", experiment)
    assert screening.promise(fit) > base.objective + 100.0
    assert settle(fit, experiment).values["tail_hardening.k3"] == pytest.approx(0.036, rel=0.05)


def test_beside_an_effect_of_many_numbers_these_move_at_the_end_only(monkeypatch):
    """Held while the others are looked for, for speed; what they absorb of a candidate is in its gain all the same."""
    random = np.random.default_rng(5)
    commands = np.stack([program(kind, 8.0, random) for kind in ("sines", "steps")], axis=1)
    truth = Robot().with_effect("nonuniform_current", gyre_11=0.03, shear_x=0.02)
    truth = truth.with_effect("rudder_offset", offset=0.05)
    experiment = record(truth, commands, Noise(), random)[0]
    drags = nominal_hypothesis(Robot(), ("head_drag_surge", "head_drag_yaw"))
    flow = drags.with_effect("nonuniform_current", 0.3)
    base = settle(evaluate(flow, np.zeros(len(flow.free)), experiment, Noise()), experiment)
    held = screening.holding(base, experiment)
    assert held.hypothesis.free == drags.free
    assert held.objective == pytest.approx(base.objective, abs=100.0)
    assert held.robot == base.robot
    first = screening.rank(base, ["rudder_offset"], experiment, lambda _: None)[0]
    monkeypatch.setattr(screening, "MANY", 100)
    assert screening.holding(base, experiment) is base
    slow = screening.rank(base, ["rudder_offset"], experiment, lambda _: None)[0]
    assert first.gain == pytest.approx(slow.gain, rel=0.05)
    assert first.gain > 50.0
    assert len(first.theta) == len(slow.theta)
    assert first.theta[-1] == pytest.approx(slow.theta[-1], rel=0.05)
