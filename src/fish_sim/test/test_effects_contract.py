# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What every effect in the table must fulfil, whatever its physics."""

from types import SimpleNamespace

import numpy as np
import pytest

from fish_sim.effects import EFFECTS
from fish_sim.effects.effect import BodyMotion, Drive
from fish_sim.ops import NUMPY
from fish_sim.robot import Robot, parameter_names
from fish_sim.scheme import stable_scheme
from fish_sim.step import Stepper

NEAR_WALL = (0.3, 0.85, 0.1)
MOTION = 8  # q and q' of a fish with one link
PHYSICS = (
    "quadratic_drag current nonuniform_current wall_effect tip_slip wake_memory wave_drag sloshing "
    "hull_asymmetry tail_hardening tail_joint_damping dry_friction tether payload rotor_imbalance"
).split()
ACTUATORS = (
    "rudder_lag rudder_delay rudder_backlash rudder_offset rudder_saturation rudder_gain rudder_placement "
    "rotor_lag rotor_saturation battery_sag"
).split()


def typical(name):
    return {
        key: p.typical if p.typical is not None else p.value
        for key, p in EFFECTS[name].parameters.items()
    }


def strongest(name):
    """Every parameter at the upper end of its range, where it has one."""
    effect = EFFECTS[name]
    return {
        k: p.highest if np.isfinite(p.highest) else typical(name)[k]
        for k, p in effect.parameters.items()
    }


def swim(effects, commands, poses=NEAR_WALL, links=1):
    """States of a fish with effects {name: parameters}, without a compiler; (T + 1, ..., NS)."""
    robot = Robot(links=links, effects=effects)
    stepper = Stepper(robot.structure, stable_scheme(robot), compiled=False)
    start = (
        np.stack([stepper.rest(pose) for pose in poses])
        if np.ndim(poses) == 2
        else stepper.rest(poses)
    )
    return stepper.rollout(start, commands, stepper.parameters(robot))


def test_every_physics_and_actuator_name_of_the_vocabulary_exists():
    assert {n: EFFECTS[n].kind for n in PHYSICS} == dict.fromkeys(PHYSICS, "physics")
    assert [effect.name for effect in EFFECTS.values()] == list(EFFECTS)
    assert {n: EFFECTS[n].kind for n in ACTUATORS} == dict.fromkeys(ACTUATORS, "actuator")


@pytest.mark.parametrize("name", EFFECTS)
def test_description_is_complete(name):
    effect = EFFECTS[name]
    assert effect.name == name
    assert effect.equation
    assert effect.source
    assert effect.__doc__
    assert effect.strength
    assert set(effect.strength) <= set(effect.parameters)
    for key, p in effect.parameters.items():
        assert p.lowest <= p.value <= p.highest and p.unit and p.source, key
        assert (p.typical is not None) == (key in effect.strength), key
        assert p.typical is None or (p.lowest <= p.typical <= p.highest and p.typical != p.value), (
            key
        )
        assert all(p.lowest <= tried <= p.highest for tried in p.tries), key


@pytest.mark.parametrize("name", EFFECTS)
def test_zero_strength_is_the_nominal_model(name, strokes):
    nominal, neutral = swim({}, strokes(60)), swim({name: {}}, strokes(60))
    np.testing.assert_allclose(neutral[:, :MOTION], nominal[:, :MOTION], rtol=0, atol=1e-11)


def test_all_effects_together_at_zero_strength_are_the_nominal_model(strokes):
    off = {name: {} for name in EFFECTS}
    nominal, neutral = swim({}, strokes(60), links=3), swim(off, strokes(60), links=3)
    np.testing.assert_allclose(neutral[..., :12], nominal[..., :12], rtol=0, atol=1e-11)


@pytest.mark.parametrize("name", EFFECTS)
def test_typical_strength_changes_the_motion_and_stays_finite(name, strokes):
    nominal, changed = swim({}, strokes(80)), swim({name: typical(name)}, strokes(80))
    assert np.isfinite(changed).all()
    assert np.abs(changed[-1, :MOTION] - nominal[-1, :MOTION]).max() > 1e-5


def test_all_effects_together_stay_finite(strokes):
    states = swim({name: typical(name) for name in EFFECTS}, strokes(80), links=3)
    assert np.isfinite(states).all()


@pytest.mark.parametrize(
    ("name", "links"),
    [*((name, 1) for name in EFFECTS), ("tail_hardening", 3), ("tail_joint_damping", 3)],
)
def test_the_upper_end_of_the_ranges_stays_finite(name, links, strokes):
    commands = strokes(100) * [12 / 9, 1.6]  # full throttle, rudder from end to end
    assert np.isfinite(swim({name: strongest(name)}, commands, (0.0, 0.0, 0.3), links)).all()


@pytest.mark.parametrize("name", EFFECTS)
def test_a_batch_equals_its_elements(name, strokes):
    poses = [NEAR_WALL, (-1.0, -0.2, 2.0), (2.0, 0.0, -1.0)]
    commands = strokes(15)
    batch = swim({name: typical(name)}, commands, poses)
    for i, pose in enumerate(poses):
        np.testing.assert_allclose(
            batch[:, i], swim({name: typical(name)}, commands, pose), atol=1e-12
        )


@pytest.mark.parametrize("name", EFFECTS)
def test_wrenches_act_on_the_head_and_only_those_of_the_walls_on_the_tail_too(name):
    effect, p = EFFECTS[name], SimpleNamespace(**typical(name))
    z = SimpleNamespace(**dict.fromkeys(effect.states, 0.3))
    for body in ("link_1", "fin"):
        motion = BodyMotion(body, 0.3, 0.85, 0.8, 0.6, 0.2, -0.1, 0.5, 0.2, 1.5, 3e-3)
        force = effect.wrench(p, motion, z, Drive(0.1, 0.2, 50.0, -300.0), NUMPY) or (0.0, 0.0, 0.0)
        assert any(force) == (name == "wall_effect")


@pytest.mark.parametrize("name", [n for n, e in EFFECTS.items() if e.dissipative])
def test_dissipative_effects_never_give_energy_to_the_fish(name):
    random = np.random.default_rng(0)
    effect, p = EFFECTS[name], SimpleNamespace(**typical(name))
    z = SimpleNamespace(**dict.fromkeys(effect.states, 0.0))
    drive = Drive(0.1, 0.2, 50.0, -300.0)
    lost = 0.0
    for x, y, u, v, w, heading in random.uniform(-1, 1, (200, 6)):
        body = BodyMotion("head", x, y, np.cos(heading), np.sin(heading), u, v, w, 0.2, 1.5, 3e-3)
        force = effect.wrench(p, body, z, drive, NUMPY) or (0.0, 0.0, 0.0)
        power = (
            force[0] * u + force[1] * v + force[2] * w - effect.joint_torque(p, 1, x, w, NUMPY) * w
        )
        assert power <= 0.0
        lost -= power
    assert lost > 0.0


def test_states_and_memory_start_at_rest_and_parameters_are_named_once():
    structure = (3, tuple(EFFECTS.values()))
    stepper = Stepper(structure, compiled=False)
    assert not stepper.rest()[3:].any()
    assert len(set(stepper.layout.state)) == len(stepper.layout.state)
    assert len(set(parameter_names(structure))) == len(parameter_names(structure))
