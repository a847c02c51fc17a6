# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What may have changed, as columns that are linear in its parameters, in typical strengths.

Flows, walls, lines and sensors are written down at the measured motion. Bodies and motors are differences of simulations with
and without. A parameter of the nominal model may have changed too; it competes under its own name.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fish_sim.robot import Robot
from fish_sysid.dataset.experiment import Experiment
from fish_sysid.diagnosis.change.channels import AT_CENTRES, MEANS, Swim, parts
from fish_sysid.diagnosis.change.simulation import Variant, simulate
from fish_sysid.diagnosis.symmetry.galilei import in_body_frame
from fish_sysid.diagnosis.symmetry.place import TERMS, flow_of, nearness
from fish_sysid.estimation.parametrization import NOMINAL_FREE, effect_class, scale_of

Array = NDArray[np.float64]

PARAMETER = "parameter "  # before the name of a nominal parameter that differs
DRAGS = "all drags"  # change together when the water's viscosity does
SMALL = 0.08  # of a parameter's logarithm
SHARE = 0.5  # typical strengths at which an effect is simulated
TETHERS = tuple((x, y) for x in (-0.8, 0.8) for y in (-0.4, 0.4))  # m
WAVES = (0.25, 0.4, 0.55)  # Hz
MEAN_FLOW = 0.03  # m/s, of the columns of a nonuniform current's mean
SIMULATED = (
    "battery_sag", "dry_friction", "hull_asymmetry", "payload", "quadratic_drag", "rotor_imbalance", "rotor_lag",
    "rotor_saturation", "rudder_backlash", "rudder_delay", "rudder_gain", "rudder_lag", "rudder_offset", "rudder_placement",
    "rudder_saturation", "tail_hardening", "tail_joint_damping", "tip_slip", "wake_memory", "wave_drag",
)  # fmt: skip
# values at which an effect is simulated, where half of each typical strength in turn says too little
PROBES: dict[str, tuple[dict[str, float], ...]] = {
    "payload": (
        {"mass": 0.03, "forward": 0.0, "left": 0.0},
        {"mass": 0.03, "forward": 0.04, "left": 0.0},
        {"mass": 0.03, "forward": 0.0, "left": 0.02},
    ),
    "rudder_saturation": ({"limit": 0.25},),
    "rotor_saturation": ({"limit": 70.0},),
    "tip_slip": ({"mobility": 0.05},),
    "wake_memory": ({"mobility": 0.05, "share": 0.0}, {"mobility": 0.05, "share": 0.5}),
    "wave_drag": tuple({"amplitude": 0.01, "speed": s} for s in (0.1, 0.15, 0.21)),
}


@dataclass(frozen=True)
class Candidate:
    """One name with its columns in each trial; of a place or frequency that is not known there is one for each tried."""

    name: str
    columns: tuple[Array, ...]  # of each trial (N, K)


def written_down(days: Sequence[Swim]) -> list[Candidate]:
    """Candidates that need no simulation."""
    forms = [(name, [column(swim) for swim in days]) for name, column in COLUMNS.items()]
    forms += [("tether", [_tether(swim, x, y) for swim in days]) for x, y in TETHERS]
    forms += [("sloshing", [_sloshing(swim, f) for swim in days]) for f in WAVES]
    return [Candidate(name, tuple(columns)) for name, columns in forms]


def simulated(
    robot: Robot, experiment: Experiment, days: Sequence[Swim], names: Sequence[str]
) -> tuple[list[Array], list[Candidate]]:
    """The robot's own channels (C, 12) in each trial, and the candidates that are simulated, nominal parameters among them."""
    variants = [Variant("", {})]
    owners: list[tuple[str, float]] = []
    for name in names:
        for values, scale in probes(name):
            variants.append(Variant(name, values))
            owners.append((name, scale))
    for parameter in NOMINAL_FREE:
        more = robot.parameters[parameter] * np.exp(SMALL)
        variants.append(Variant("", {parameter: more}))
        owners.append((PARAMETER + parameter, 1.0))
    own, *changed = simulate(robot, experiment, days, variants)
    columns: dict[str, list[list[Array]]] = {}
    for (name, scale), channels in zip(owners, changed, strict=True):
        columns.setdefault(name, []).append(
            [s.flat((c - o) / scale) for s, c, o in zip(days, channels, own, strict=True)]
        )
    drags = [c for name, found in columns.items() if "_drag_" in name for c in found]
    if drags:
        columns[PARAMETER + DRAGS] = drags
    return own, [
        Candidate(name, tuple(np.column_stack(trial) for trial in zip(*found, strict=True)))
        for name, found in columns.items()
    ]


def probes(name: str) -> list[tuple[dict[str, float], float]]:
    """Values at which an effect is simulated, and in how many typical strengths."""
    effect = effect_class(name)
    neutral = {k: p.value for k, p in effect.parameters.items()}
    if name in PROBES:
        return [({**neutral, **values}, 1.0) for values in PROBES[name]]
    return [
        ({**neutral, k: neutral[k] + SHARE * (typical(name, k) - neutral[k])}, SHARE)
        for k in effect.strength
    ]


def typical(name: str, key: str) -> float:
    """A typical value of an effect's parameter."""
    parameter = effect_class(name).parameters[key]
    return parameter.value + scale_of(parameter) if parameter.typical is None else parameter.typical


def _flow(swim: Swim, vx: Array | float, vy: Array | float) -> Array:
    """Column (N, 1) of water that moves with (vx, vy) [m/s] in the pool frame."""
    both = np.broadcast_arrays(vx, vy, swim.means.t)[:2]
    u, v = in_body_frame(swim.means, np.column_stack(both)).reshape(2, -1)
    return swim.means_only(u=u, v=v)[:, None]


def _current(swim: Swim) -> Array:
    return np.hstack(
        [_flow(swim, typical("current", "x"), 0.0), _flow(swim, 0.0, typical("current", "y"))]
    )


def _varying(swim: Swim) -> Array:
    x, y, _ = swim.means.pose.T
    columns = [_flow(swim, MEAN_FLOW, 0.0), _flow(swim, 0.0, MEAN_FLOW)]
    for name in TERMS:
        columns.append(_flow(swim, *flow_of(name, typical("nonuniform_current", name), x, y)))
    return np.hstack(columns)


def _walls(swim: Swim) -> Array:
    u, v, r = swim.means.velocity.T
    near = nearness(swim.means)
    slower = swim.means_only(u=-u * near)
    return np.column_stack([slower, swim.means_only(v=-v * near, r=-r * near)])


def _tether(swim: Swim, x: float, y: float) -> Array:
    away = np.array([x, y]) - swim.means.pose[:, :2]
    reach = np.maximum(np.linalg.norm(away, axis=1), 1e-6)
    pull = 0.03 * (np.maximum(reach - 0.4, 0.0) / reach)[:, None] * away
    u, v = in_body_frame(swim.means, pull).reshape(2, -1)
    return np.column_stack([swim.means_only(u=u), swim.means_only(v=v)])


def _sloshing(swim: Swim, frequency: float) -> Array:
    phase = 2.0 * np.pi * frequency * swim.means.t
    return np.hstack([_flow(swim, 0.01 * wave(phase), 0.0) for wave in (np.sin, np.cos)])


def _camera_latency(swim: Swim) -> Array:
    u, v, r = typical("camera_latency", "delay") * swim.aged.T
    # the yaw rate is the gyro's, or the camera's without one
    centres = np.column_stack([u, v, np.where(np.isfinite(swim.means.gyro), 0.0, r), r])
    windows = np.column_stack(
        [-typical("camera_latency", "delay") * swim.windows[:, 1], np.zeros(len(swim.windows))]
    )
    return swim.flat(np.hstack([centres, np.zeros((len(u), AT_CENTRES - MEANS))]), windows)[:, None]


def _heading_offset(swim: Swim) -> Array:
    offset, (u, v, _) = typical("camera_heading_offset", "offset"), swim.means.velocity.T
    force = -offset * swim.force.terms[:, 1]
    return (swim.means_only(u=offset * v, v=-offset * u) + swim.flat(force=force))[:, None]


def _camera_scale(swim: Swim) -> Array:
    more, (u, v, _) = typical("camera_scale", "factor") - 1.0, swim.means.velocity.T
    force = more * swim.force.terms[:, 0]
    return (swim.means_only(u=more * u, v=more * v) + swim.flat(force=force))[:, None]


def _gyro_scale(swim: Swim) -> Array:
    more, r = typical("gyro_scale", "factor") - 1.0, np.nan_to_num(swim.means.gyro)
    H = np.zeros_like(swim.amplitudes)
    H[:, 0] = more * swim.amplitudes[:, 0]
    centres = np.column_stack([0.0 * r, 0.0 * r, more * r, -more * r])
    windows = np.column_stack([np.zeros(len(swim.windows)), -more * swim.windows[:, 3]])
    turns = -more * swim.turns[:, 1]
    return swim.flat(np.hstack([centres, parts(H)]), windows, turns=turns)[:, None]


def _imu_misalignment(swim: Swim) -> Array:
    """Measured = R(-angle) force: ahead + angle * left, left - angle * ahead, at the stroke."""
    angle, H = typical("imu_misalignment", "angle"), np.zeros_like(swim.amplitudes)
    left, ahead = 1, 2
    H[:, left], H[:, ahead] = -angle * swim.amplitudes[:, ahead], angle * swim.amplitudes[:, left]
    centres = np.hstack([np.zeros((len(H), MEANS)), parts(H)])
    return swim.flat(centres, force=angle * swim.force.terms[:, 1])[:, None]


def _imu_latency(swim: Swim) -> Array:
    delay, multiple = typical("imu_latency", "delay"), np.array([1, 1, 1, 2])
    H = -1j * delay * swim.stroke[:, None] * multiple * swim.amplitudes
    windows = np.column_stack([delay * swim.windows[:, 1], np.zeros(len(swim.windows))])
    return swim.flat(np.hstack([np.zeros((len(H), MEANS)), parts(H)]), windows)[:, None]


COLUMNS = {
    "current": _current,
    "nonuniform_current": _varying,
    "wall_effect": _walls,
    "camera_latency": _camera_latency,
    "camera_heading_offset": _heading_offset,
    "camera_scale": _camera_scale,
    "gyro_scale": _gyro_scale,
    "imu_misalignment": _imu_misalignment,
    "imu_latency": _imu_latency,
}
POOL_AND_SENSORS = (*COLUMNS, "tether", "sloshing")  # a fish has none of them of itself
