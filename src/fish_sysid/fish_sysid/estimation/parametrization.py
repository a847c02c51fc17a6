# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""A hypothesis: a robot with effects and sensor errors, and which of its parameters are free.

Free parameters live in a vector theta: nominal parameters as logarithms of their ratio to the start (they are positive),
effect and sensor parameters as (value - neutral) / scale. Both have a wide Gaussian prior, which only matters where the
data do not determine them.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from fish_report.errors import UserError
from fish_sim.effects import EFFECTS
from fish_sim.effects.effect import Effect
from fish_sim.parameter import Parameter
from fish_sim.robot import Robot
from fish_sim.sensors import SENSOR_EFFECTS
from fish_sim.sensors.sensor_effect import SensorEffect
from fish_sysid.estimation.ekf import filter_stepper
from fish_sysid.estimation.ekf_types import SensorModel
from fish_sysid.estimation.thresholds import LARGE_EFFECT, START_STRENGTH

Array = NDArray[np.float64]

# Free by default: what a ruler and scales do not measure.
NOMINAL_FREE = (
    "head_added_mass_surge",
    "head_added_mass_sway",
    "head_inertia",
    "link_added_mass_sway",
    "link_inertia_factor",
    "fin_added_mass_sway",
    "fin_inertia_factor",
    "tail_stiffness",
    "rotor_inertia",
    "head_drag_surge",
    "head_drag_sway",
    "head_drag_yaw",
    "link_drag_surge",
    "link_drag_sway",
    "fin_drag_surge",
    "fin_drag_sway",
    "servo_rate_limit",
)
LOG_PRIOR = {
    "servo_rate_limit": 0.2,
    "link_inertia_factor": 0.3,
    "fin_inertia_factor": 0.3,
}  # others: WIDE_PRIOR
WIDE_PRIOR = 0.5  # of the logarithm: "tens of per cent"
# standard deviation of the logarithm by what a robot.yaml says of a parameter: 5 %, tens of per cent, a factor of three
KNOWLEDGE_PRIOR = {"measured": 0.05, "estimated": 0.3, "unknown": 1.1}
EFFECT_PRIOR = 4.0  # typical strengths

# sensor effect -> field of the filter's SensorModel
SENSOR_FIELDS = {
    "camera_latency": "camera_latency",
    "camera_heading_offset": "camera_heading_offset",
    "camera_scale": "camera_scale",
    "gyro_scale": "gyro_scale",
    "imu_misalignment": "imu_misalignment",
}


EffectTable = Mapping[str, type[Effect]]
AnyEffect = type[Effect] | type[SensorEffect]


def effect_class(name: str, effects: EffectTable = EFFECTS) -> AnyEffect:
    """The class of an effect, physics, actuator or sensor. Raises ValueError for an unknown name."""
    table: dict[str, AnyEffect] = {**effects, **SENSOR_EFFECTS}
    if name not in table:
        raise ValueError(f"unknown effect {name!r}; known: {', '.join(table)}")
    return table[name]


def start_values(effect: AnyEffect, fraction: float) -> dict[str, float]:
    """Every strength parameter at `fraction` of the way from neutral to typical, the others at plausible values."""
    values = {}
    for key, parameter in effect.parameters.items():
        typical = parameter.value if parameter.typical is None else parameter.typical
        strong = key in effect.strength
        values[key] = (
            parameter.value + fraction * (typical - parameter.value) if strong else typical
        )
    return values


def scale_of(parameter: Parameter) -> float:
    """A natural unit of an effect's parameter: distance from neutral to typical, or its size."""
    if parameter.typical is not None and parameter.typical != parameter.value:
        return abs(parameter.typical - parameter.value)
    return abs(parameter.value) or 1.0


@dataclass(frozen=True)
class Hypothesis:
    """Structure, start values and free parameters."""

    robot: Robot  # with the effects and sensor errors of the hypothesis at their start values
    free: tuple[str, ...]  # "head_drag_surge", "current.x", "camera_latency.delay"

    @property
    def names(self) -> tuple[str, ...]:
        """Effects and sensor errors beyond the nominal model."""
        return (*(e for e in self.robot.effects if e != "disturbance"), *self.robot.sensors)

    @cached_property
    def parametrization(self) -> Parametrization:
        """Theta <-> robot, built once."""
        return Parametrization(self)

    def __reduce__(self) -> tuple[type[Hypothesis], tuple[Robot, tuple[str, ...]]]:
        """Pickled without the parametrization, whose kernels belong to one process."""
        return Hypothesis, (self.robot, self.free)

    def effect(self, name: str) -> AnyEffect:
        """The class of an effect that the robot may have. Raises ValueError for an unknown name."""
        return effect_class(name, self.robot.table)

    def own(self, name: str) -> NDArray[np.bool_]:
        """(K,) which free parameters are those of an effect."""
        return np.array([free.startswith(f"{name}.") for free in self.free], dtype=bool)

    def with_effect(self, name: str, start: float = START_STRENGTH) -> Hypothesis:
        """One more effect, free, its strength at `start` times the typical one."""
        values = start_values(self.effect(name), start)
        free = tuple(f"{name}.{key}" for key in values)
        return Hypothesis(self.robot.with_effect(name, **values), self.free + free)

    def without(self, name: str) -> Hypothesis:
        """The hypothesis less one effect."""
        free = tuple(f for f in self.free if not f.startswith(name + "."))
        return Hypothesis(self.robot.without_effect(name), free)

    def fixing(self, held: Collection[str], theta: Array) -> Hypothesis:
        """The hypothesis with the free parameters `held` fixed at what they are at theta (K,)."""
        stays = np.array([name in held for name in self.free], dtype=bool)
        origin = self.parametrization.origin()
        robot = self.parametrization.robot(np.where(stays, theta, origin))
        return Hypothesis(robot, tuple(name for name in self.free if name not in held))

    @property
    def large(self) -> tuple[str, ...]:
        """Free parameters of effects with more than LARGE_EFFECT."""
        owner = {free: free.split(".")[0] for free in self.free if "." in free}
        return tuple(f for f, e in owner.items() if len(self.effect(e).parameters) > LARGE_EFFECT)


def nominal_hypothesis(robot: Robot, free: tuple[str, ...] = NOMINAL_FREE) -> Hypothesis:
    """The robot as it is, its nominal parameters free, with the wrench that the filter drives.

    Parameters that are 0 stay 0: no factor changes them. Raises UserError where the robot has a wrench of its own, whose place
    the filter's wrench takes.
    """
    if any(robot.effects.get("disturbance", {}).values()):
        raise UserError(
            f"robot {robot.name!r} has the effect disturbance with values other than 0, which stands for what a model does not "
            "explain and is estimated from recordings; expected a robot without it; delete it, or use an effect with a name"
        )
    moved = tuple(name for name in free if robot.parameters.get(name) != 0.0)
    return Hypothesis(robot.with_effect("disturbance"), moved)


def sensor_model(robot: Robot) -> SensorModel:
    """What the robot's sensor errors do to the truth, none of them free."""
    own = robot.sensors.items()
    values = {SENSOR_FIELDS[k]: next(iter(v.values())) for k, v in own if k in SENSOR_FIELDS}
    return SensorModel(**values, free={}, slope={})


def left_at_zero(robot: Robot) -> tuple[str, ...]:
    """Parameters of a nominal model that would be free if they were not 0 in this robot."""
    return tuple(name for name in NOMINAL_FREE if robot.parameters[name] == 0.0)


def extend(
    theta: Array,
    hypothesis: Hypothesis,
    name: str,
    strength: float,
    place: Mapping[str, float] | None = None,
) -> Array:
    """theta (K,) of a hypothesis whose last effect is `name`, from that of the one without it.

    strength: of the effect, in typical ones; place: values of its parameters that say where or how fast.
    """
    values = {**start_values(hypothesis.effect(name), strength), **(place or {})}
    everything = np.concatenate([np.ones(len(theta)), list(values.values())])
    own = hypothesis.parametrization.encode(everything)[len(theta) :]
    return np.concatenate([theta, own])


class Parametrization:
    """theta (K,) <-> physical values (K,) of the free parameters <-> robot, for one hypothesis."""

    def __init__(self, hypothesis: Hypothesis) -> None:
        self.hypothesis = hypothesis
        self.stepper = filter_stepper(hypothesis.robot)
        self.start = self.read(hypothesis.robot)
        self.is_log = np.array(["." not in name for name in hypothesis.free], dtype=bool)
        rows = np.array([self._row(name) for name in hypothesis.free]).reshape(-1, 5)
        self.neutral, self.scale, self.prior, self.lowest, self.highest = rows.T

    def origin(self) -> Array:
        """theta of the hypothesis's start values."""
        return self.encode(self.start)

    def at_nominal(self, theta: Array) -> Array:
        """theta with the nominal parameters at the robot's own values, the effects as they are."""
        return np.where(self.is_log, 0.0, theta)

    def encode(self, values: Array) -> Array:
        """theta of physical values."""
        linear = (values - self.neutral) / self.scale
        return np.where(
            self.is_log,
            np.log(np.maximum(values, 1e-300) / np.where(self.is_log, self.neutral, 1.0)),
            linear,
        )

    def decode(self, theta: Array) -> Array:
        """Physical values of theta."""
        return np.where(
            self.is_log, self.neutral * np.exp(theta), self.neutral + self.scale * theta
        )

    def slope(self, theta: Array) -> Array:
        """d value / d theta."""
        return np.where(self.is_log, self.decode(theta), self.scale)

    def clip(self, theta: Array) -> Array:
        """Into the physical ranges."""
        values = np.clip(self.decode(theta), self.lowest, self.highest)
        return self.encode(values)

    def robot(self, theta: Array) -> Robot:
        """The robot at theta."""
        robot = self.hypothesis.robot
        parameters, effects = dict(robot.parameters), {k: dict(v) for k, v in robot.effects.items()}
        sensors = {k: dict(v) for k, v in robot.sensors.items()}
        # rounding may leave a range's edge
        values = np.clip(self.decode(theta), self.lowest, self.highest)
        for name, value in zip(self.hypothesis.free, values, strict=True):
            if "." not in name:
                parameters[name] = float(value)
                continue
            effect, key = name.split(".")
            (effects if effect in effects else sensors)[effect][key] = float(value)
        return replace(robot, parameters=parameters, effects=effects, sensors=sensors)

    def filter_inputs(self, theta: Array) -> tuple[Array, Array, SensorModel]:
        """(p (NP,), dp (K, NP), sensors) for the filter; derivatives are with respect to theta."""
        robot = self.robot(theta)
        p = self.stepper.parameters(robot)
        slope = self.slope(theta)
        dp = np.zeros((len(theta), len(p)))
        sensor_free: dict[str, int] = {}
        index = {name: i for i, name in enumerate(self.stepper.layout.parameters)}
        for j, name in enumerate(self.hypothesis.free):
            if name in index:
                dp[j, index[name]] = slope[j]
            else:
                sensor_free[SENSOR_FIELDS[name.split(".")[0]]] = j
        slopes = {field: float(slope[j]) for field, j in sensor_free.items()}
        return p, dp, replace(sensor_model(robot), free=sensor_free, slope=slopes)

    def read(self, robot: Robot) -> Array:
        """Physical values of the free parameters in a robot of this structure."""
        values = {**robot.parameters}
        for table in (robot.effects, robot.sensors):
            values.update({f"{e}.{k}": v for e, own in table.items() for k, v in own.items()})
        return np.array([values[name] for name in self.hypothesis.free])

    def _row(self, name: str) -> tuple[float, float, float, float, float]:
        """(neutral, scale, prior std of theta, lowest, highest) of a free parameter."""
        if "." not in name:
            robot = self.hypothesis.robot
            value, prior = robot.parameters[name], LOG_PRIOR.get(name, WIDE_PRIOR)
            if name in robot.knowledge:
                prior = KNOWLEDGE_PRIOR[robot.knowledge[name]]
            return value, 1.0, prior, value * 1e-3, value * 1e3
        effect, key = name.split(".")
        parameter = self.hypothesis.effect(effect).parameters[key]
        return (
            parameter.value,
            scale_of(parameter),
            EFFECT_PRIOR,
            parameter.lowest,
            parameter.highest,
        )
