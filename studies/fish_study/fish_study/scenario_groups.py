# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The groups of the study: who hides what from whom. Each is a row of the table and a function (random, number) -> Scenario."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np

from fish_sim.effects import EFFECTS
from fish_sim.effects.effect import Effect
from fish_sim.parameter import Parameter
from fish_sim.sensors import SENSOR_EFFECTS
from fish_sim.sensors.sensor_effect import SensorEffect
from fish_study.plant_effects import OTHER_FORMS, OUTSIDE
from fish_study.scenario import Scenario
from fish_sysid.diagnosis.vocabulary import candidates
from fish_sysid.estimation.parametrization import SENSOR_FIELDS

Random = np.random.Generator
Item = TypeVar("Item")

SPREAD = 0.25  # of the true fish's parameters about the nominal ones
MEASURED = (
    "head_mass",
    "hinge_offset",
    "link_length",
    "link_mass",
    "fin_length",
    "fin_mass",
    "rudder_range",
    "servo_rate_limit",
)
VALUE_SPREAD = 0.15  # of strengths about the typical one
ELSEWHERE = {  # parameters that say where or when; drawn afresh in every scenario
    "tether": {"x": (-0.6, 0.6), "y": (-0.4, 0.4), "length": (0.3, 0.6)},
    "payload": {"forward": (-0.05, 0.05), "left": (-0.03, 0.03)},
    "wave_drag": {"speed": (0.10, 0.20), "width": (0.025, 0.04)},
    "sloshing": {"frequency": (0.25, 0.6)},
    "wall_effect": {"length": (0.15, 0.25)},
    "wake_memory": {"time_constant": (0.2, 0.4)},
    "battery_sag": {"time_constant": (0.5, 2.0)},
    "vortex": {"at_x": (-0.8, 0.8), "at_y": (-0.4, 0.4), "core": (0.3, 0.8)},
    "jet": {"at_x": (-0.8, 0.8), "at_y": (-0.4, 0.4), "width": (0.25, 0.4)},
}
SIGNED = (
    "current",
    "nonuniform_current",
    "hull_asymmetry",
    "rudder_offset",
    "camera_heading_offset",
    "imu_misalignment",
    "rotor_imbalance",
    "compass",
    "jet",
    "vortex",
)
# what can be put into recordings exactly
INJECTED = (
    "current",
    "camera_latency",
    "camera_scale",
    "camera_heading_offset",
    "gyro_scale",
    "imu_misalignment",
    "rudder_gain",
    "rudder_offset",
    "rudder_delay",
)
LIMITS = ("rudder_saturation", "rotor_saturation")  # act by being small
HIDDEN_BY_THE_ENCODER = ("rotor_lag", "rotor_saturation", "battery_sag")
ABSORBED = (
    "quadratic_drag",
    "dry_friction",
    "wave_drag",
    "payload",
    "rudder_gain",
    "tail_joint_damping",
    "tail_hardening",
)
PAIRS = (
    ("current", "rudder_offset"),
    ("quadratic_drag", "camera_latency"),
    ("tip_slip", "current"),
    ("wall_effect", "rudder_lag"),
    ("tail_hardening", "rudder_offset"),
    ("hull_asymmetry", "rudder_delay"),
    ("nonuniform_current", "camera_scale"),
    ("tether", "rudder_gain"),
    ("quadratic_drag", "rudder_backlash"),
    ("sloshing", "camera_heading_offset"),
)
NOISES = (0.5, 1.0, 2.0, 4.0)
STRENGTHS = (0.125, 0.25, 0.5, 1.0, 2.0)
# number of links, integrator, its steps in 10 ms
OTHER_PLANTS = ((3, "dop853", 2), (4, "dop853", 4), (5, "dop853", 8), (3, "rk4", 8), (5, "rk4", 20))


def draw_effect(name: str, strength: float, random: Random) -> dict[str, float]:
    """Values of an effect at `strength` typical ones, a little spread; where and when are drawn."""
    table: dict[str, type[Effect] | type[SensorEffect]] = {
        **EFFECTS,
        **SENSOR_EFFECTS,
        **OUTSIDE,
        **OTHER_FORMS,
    }
    effect = table[name]
    sign = float(random.choice([-1.0, 1.0])) if name in SIGNED else 1.0
    values = {}
    for key, parameter in effect.parameters.items():
        if key in ELSEWHERE.get(name, {}):
            values[key] = float(random.uniform(*ELSEWHERE[name][key]))
        elif key in effect.strength:
            values[key] = _strong(
                parameter, strength * random.uniform(1 - VALUE_SPREAD, 1 + VALUE_SPREAD), sign
            )
        else:
            values[key] = parameter.value
    return values


def _strong(parameter: Parameter, strength: float, sign: float) -> float:
    """Neutral + strength (typical - neutral); a limit, which acts by being small, is the typical one over the strength."""
    typical = parameter.value if parameter.typical is None else parameter.typical
    if parameter.value == parameter.highest:  # neutral where it can limit nothing
        return float(np.clip(typical / strength, parameter.lowest, parameter.highest))
    value = parameter.value + sign * strength * (typical - parameter.value)
    return float(np.clip(value, parameter.lowest, parameter.highest))


def _world(group: str, random: Random, names: tuple[str, ...], strength: float = 1.0) -> Scenario:
    """A fish that is not the nominal one, with these effects."""
    from fish_sim.robot import nominal_parameters

    free = [n for n in nominal_parameters(3) if n not in MEASURED]
    factors = {n: float(random.uniform(1 - SPREAD, 1 + SPREAD)) for n in free}
    encoder = not set(names) & set(HIDDEN_BY_THE_ENCODER) and bool(random.random() > 0.15)
    effects = {name: draw_effect(name, strength, random) for name in names}
    seed = int(random.integers(2**62))
    return Scenario(group, seed, effects, strength, encoder=encoder, parameters=factors)


def _turn(items: Sequence[Item], number: int) -> Item:
    return items[number % len(items)]


def single(random: Random, number: int) -> Scenario:
    """One effect of the vocabulary (or another form of it) after the other at the strengths of the known sets, mixed trials."""
    return _world("single", random, (_turn((*candidates(), *OTHER_FORMS), number),))


def absorbed(random: Random, number: int) -> Scenario:
    """Effects that look like a nominal parameter as long as the fish keeps to one speed."""
    return replace(_world("absorbed", random, (_turn(ABSORBED, number),)), trials="one_speed")


def feedback(random: Random, number: int) -> Scenario:
    """The same effects, every trial under feedback control."""
    return replace(_world("feedback", random, (_turn(candidates(), number),)), trials="closed")


def noise(random: Random, number: int) -> Scenario:
    """A ladder of noise: water and sensors."""
    scenario = _world("noise", random, (str(random.choice(candidates())),))
    return replace(scenario, noise=_turn(NOISES, number))


def ladder(random: Random, number: int) -> Scenario:
    """A ladder of strengths, for power curves. A weak limit is one that no command reaches: nothing would be hidden."""
    strength = _turn(STRENGTHS, number)
    names = [name for name in candidates() if strength >= 1.0 or name not in LIMITS]
    return _world("ladder", random, (str(random.choice(names)),), strength)


def two(random: Random, number: int) -> Scenario:
    """Two effects at once."""
    return _world("two", random, _turn(PAIRS, number))


def sensor(random: Random, number: int) -> Scenario:
    """The sensor is wrong, not the fish."""
    return _world("sensor", random, (_turn(tuple(SENSOR_FIELDS), number),))


def outside(random: Random, number: int) -> Scenario:
    """Something that the vocabulary has no name for."""
    return _world("outside", random, (_turn(tuple(OUTSIDE), number),))


def null(random: Random, number: int) -> Scenario:
    """Nothing is hidden; other noise, more tail links than the tool's model, other integrators."""
    links, method, substeps = _turn(OTHER_PLANTS, number)
    level = float(random.choice((0.5, 1.0, 2.0)))
    return replace(
        _world("null", random, ()), links=links, method=method, substeps=substeps, noise=level
    )


def mujoco(random: Random, number: int) -> Scenario:
    """The second plant: another engine, its own water, and one of its own things concealed."""
    from fish_study.mujoco_effects import draw

    name, values = draw(number, random)
    effects = {name: values} if name else {}
    return replace(
        _world("mujoco", random, ()), effects=effects, plant="mujoco", links=5, encoder=True
    )


def injected(random: Random, number: int) -> Scenario:
    """A user's recordings, some of which get one of nine effects exactly, or nothing; the others are the baseline."""
    name = _or_nothing(INJECTED, number)
    effects = {name: draw_effect(name, 1.0, random)} if name else {}
    return Scenario("injected", int(random.integers(2**62)), effects, plant="recordings")


def mujoco_pair(random: Random, number: int) -> Scenario:
    """The second plant yesterday and today: one or two of its things changed, or nothing."""
    from fish_study.mujoco_effects import CHANGES, drawn

    changed = _or_nothing(CHANGES, number, ())
    world = _world("mujoco-pair", random, ())
    effects = {name: drawn(name, random) for name in changed}
    return replace(
        world,
        effects=effects,
        plant="mujoco",
        links=5,
        encoder=True,
        old=18,
        count=9,
        duration=12.0,
    )


def _or_nothing(items: Sequence[Item], number: int, nothing: Any = "") -> Any:
    """The items in turn, after every four of them nothing."""
    return nothing if number % 5 == 4 else _turn(items, number - number // 5)


GROUPS: dict[str, Callable[[Random, int], Scenario]] = {
    f.__name__.replace("_", "-"): f
    for f in (
        single, absorbed, feedback, noise, ladder, two, sensor, outside, null, mujoco, mujoco_pair, injected
    )
}  # fmt: skip
PAIRS_OF_DAYS = ("mujoco-pair", "injected")  # what changed against a baseline is asked
# share of a study's scenarios
SHARES = {
    "single": 0.22,
    "absorbed": 0.06,
    "feedback": 0.12,
    "noise": 0.08,
    "ladder": 0.12,
    "two": 0.08,
    "sensor": 0.04,
    "outside": 0.08,
    "null": 0.14,
    "mujoco": 0.06,
    "mujoco-pair": 0.06,
    "injected": 0.06,
}


def draw_scenarios(count: int, groups: list[str], seed: int) -> list[Scenario]:
    """`count` scenarios over the groups in proportion to SHARES, in an order that tells nothing. Raises ValueError."""
    unknown = [g for g in groups if g not in GROUPS]
    if unknown:
        raise ValueError(f"group {unknown[0]!r}: unknown; known: {', '.join(GROUPS)}")
    if count < 1:
        raise ValueError(f"scenarios: got {count}; expected at least 1")
    random = np.random.default_rng(seed)
    wanted = np.array([SHARES[g] for g in groups]) / sum(SHARES[g] for g in groups) * count
    numbers = np.floor(wanted).astype(int)
    for k in np.argsort(numbers - wanted)[: count - numbers.sum()]:
        numbers[k] += 1
    scenarios = []
    for group, number in zip(groups, numbers, strict=True):
        first = int(random.integers(1000))
        scenarios += [
            GROUPS[group](np.random.default_rng(random.integers(2**62)), first + i)
            for i in range(number)
        ]
    return [scenarios[i] for i in random.permutation(len(scenarios))]
