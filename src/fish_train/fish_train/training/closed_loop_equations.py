# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""One control period of the closed loop on generic scalars: what is differentiated, and what the node runs.

The laws are fish_control's own functions; this module only strings them together and adds the stage cost

    J = w_psi e_psi^2 + w_u e_u^2 + w_y e_y^2 + w_d |change of set-point|^2 + w_g |gains|^2 + w_c |change of gains|^2

with the gains as shares of their ranges, the set-point as shares of rudder range and full throttle. Order in a
period of CONTROL_PERIOD: sense (errors and policy inputs), policy, act (gains and set-point), then for each 10 ms of
physics drive (the actuators' commands). Everything is a list of scalars in the order of the *_NAMES below.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from fish_control.control_law import (
    ActuatorState,
    ControlLimits,
    ControlState,
    Errors,
    Gains,
    Setpoint,
    actuator_step,
    control_step,
)
from fish_control.line_of_sight import (
    GUIDANCE_NAMES,
    GuidanceConfig,
    GuidanceState,
    Motion,
    PathAhead,
    TrackingErrors,
    heading_error,
    mean_heading,
    observe,
    through_water,
    tracking_errors,
)
from fish_control.path_batch import TrackerConfig
from fish_control.policy import policy_inputs
from fish_control.policy_spec import INPUTS, OUTPUTS
from fish_sim.model import DT
from fish_sim.ops import Scalar

CONTROL_PERIOD = 0.02  # s, the controller node's
PHYSICS_STEPS = round(CONTROL_PERIOD / DT)

SETPOINT_NAMES = Setpoint._fields
LAST_NAMES = (*Gains._fields, *SETPOINT_NAMES)  # of the period before
GEOMETRY_NAMES = (
    # nearest of the searched points, where the foot of the perpendicular is linearised
    "base_x",
    "base_y",
    "base_heading",
    "lowest",
    "highest",
    # table row at the progress, and the way from it to the base
    "row_x",
    "row_y",
    "row_heading",
    "row_curvature",
    "row_chord",
    "shift",
    # path segment on which the lookahead point lies
    "from_x",
    "from_y",
    "to_x",
    "to_y",
)
ERROR_NAMES = Errors._fields  # what the control law is told
INPUT_COUNTS = {"policy": len(INPUTS), "schedule": 2, "none": 0}
SPEED_MIDDLE, SPEED_SPAN = 0.2, 0.1  # m/s, of a schedule's first input
CURVATURE_SPAN = 3.0  # 1/m, of its second
REPORT_NAMES = ("cross_track", "heading", "speed")  # of the true motion
COST_NAMES = ("heading", "speed", "cross_track", "setpoint_change", "gain_size", "gain_change")


@dataclass(frozen=True)
class Law:
    """Constants of the law that is trained; the weights file carries them.

    inputs: what the policy looks at: `policy` the six of the weights file; for baselines `schedule` wanted speed and
    curvature of the path, or `none`.
    """

    inputs: str = "policy"
    limits: ControlLimits = field(default_factory=ControlLimits)
    guidance: GuidanceConfig = field(default_factory=GuidanceConfig)
    tracker: TrackerConfig = field(default_factory=TrackerConfig)


def motion(q: Sequence[Scalar], qd: Sequence[Scalar], xp: Any) -> list[Scalar]:
    """`Motion` of the head: pose in the pool, velocity over ground in base_link."""
    cos, sin = xp.cos(q[2]), xp.sin(q[2])
    return [q[0], q[1], q[2], cos * qd[0] + sin * qd[1], cos * qd[1] - sin * qd[0], qd[2]]


def path_ahead(
    x: Scalar, y: Scalar, geometry: Sequence[Scalar], lookahead: float, xp: Any
) -> PathAhead:
    """What a path says at a position, given which of its samples are nearest and ahead (GEOMETRY_NAMES).

    Differentiable in the position: the foot of the perpendicular moves along the tangent, the lookahead point along
    its segment. The same numbers as `PathBatch.update`.
    """
    (
        base_x,
        base_y,
        base_heading,
        lowest,
        highest,
        row_x,
        row_y,
        row_heading,
        row_curvature,
        chord,
        shift,
        from_x,
        from_y,
        to_x,
        to_y,
    ) = geometry
    along = xp.cos(base_heading) * (x - base_x) + xp.sin(base_heading) * (y - base_y)
    delta = shift + xp.fmin(xp.fmax(along, lowest), highest)
    mean = row_heading + 0.5 * row_curvature * delta
    before = xp.sqrt((from_x - x) ** 2 + (from_y - y) ** 2)
    after = xp.sqrt((to_x - x) ** 2 + (to_y - y) ** 2)
    tiny = 1e-12  # m, the segment is a point where the path does not leave the circle
    share = xp.fmin(xp.fmax((lookahead - before) / xp.fmax(after - before, tiny), 0.0), 1.0)
    return PathAhead(
        x=row_x + delta * xp.cos(mean),
        y=row_y + delta * xp.sin(mean),
        heading=row_heading + row_curvature * delta,
        curvature=row_curvature,
        target_x=from_x + share * (to_x - from_x),
        target_y=from_y + share * (to_y - from_y),
        chord=chord,
    )


def sense(
    seen: Sequence[Scalar],
    true: Sequence[Scalar],
    guidance: Sequence[Scalar],
    setpoint: Sequence[Scalar],
    geometry_seen: Sequence[Scalar],
    geometry_true: Sequence[Scalar],
    speed: Scalar,
    weights: Sequence[Scalar],
    law: Law,
    xp: Any,
) -> dict[str, list[Scalar]]:
    """Policy inputs, errors and guidance memory from the motion that is seen; cost and report from the true one.

    seen: the motions of the last PHYSICS_STEPS, oldest first, one after the other; the nodes observe at that rate, too.
    setpoint: of rudder [rad] and throttle meanwhile.
    """
    width, lookahead = len(Motion._fields), law.tracker.lookahead
    state = GuidanceState.of(guidance)
    for k in range(PHYSICS_STEPS):
        moved = Motion(*seen[k * width : (k + 1) * width])
        state = observe(state, moved, Setpoint(*setpoint), DT, law.limits, law.guidance, xp)
    path = path_ahead(moved.x, moved.y, geometry_seen, lookahead, xp)
    told, errors = _wanted(state, moved, path, speed, law, xp)
    actual = Motion(*true)
    truth = path_ahead(actual.x, actual.y, geometry_true, lookahead, xp)
    real, missed = _wanted(state, actual, truth, speed, law, xp)
    cost = (
        weights[0] * real.heading**2
        + weights[1] * real.speed**2
        + weights[2] * missed.cross_track**2
    )
    return {
        "inputs": _inputs(moved, state, told, errors.cross_track, path.curvature, speed, law, xp),
        "errors": list(told),
        "guidance": state.flat,
        "report": [missed.cross_track, real.heading, real.speed],
        "cost": [cost],
    }


def _wanted(
    state: GuidanceState, moved: Motion, path: PathAhead, speed: Scalar, law: Law, xp: Any
) -> tuple[Errors, TrackingErrors]:
    """Inputs of the control law and outputs of the planner."""
    errors = tracking_errors(state.stroke, moved, path, speed, law.guidance, xp)
    water = through_water(state, errors.course, path.curvature, speed, xp)
    e_psi = heading_error(state, moved, water, law.guidance, xp)
    return Errors(e_psi, errors.speed, water.curvature, water.speed, state.water.thrust), errors


def _inputs(
    moved: Motion,
    state: GuidanceState,
    errors: Errors,
    cross_track: Scalar,
    curvature: Scalar,
    speed: Scalar,
    law: Law,
    xp: Any,
) -> list[Scalar]:
    if law.inputs == "policy":
        heading = mean_heading(state.stroke, moved)
        values = moved.surge, speed, errors.heading, errors.speed, cross_track
        return list(policy_inputs(heading, *values, xp))
    if law.inputs == "schedule":
        return schedule_inputs(speed, curvature, xp)
    return []


def schedule_inputs(speed: Scalar, curvature: Scalar, xp: Any) -> list[Scalar]:
    """What scheduled gains depend on: wanted speed [m/s] and size of the path's curvature [1/m], normalised."""
    return [(speed - SPEED_MIDDLE) / SPEED_SPAN, xp.fabs(curvature) / CURVATURE_SPAN]


def gains_of(raw: Sequence[Scalar], xp: Any) -> Gains:
    """Last layer's outputs to gains: tanh and affine scaling to the ranges."""
    return Gains(
        *(
            o.low + 0.5 * (o.high - o.low) * (1.0 + xp.tanh(v))
            for v, o in zip(raw, OUTPUTS, strict=True)
        )
    )


def act(
    errors: Sequence[Scalar],
    control: Sequence[Scalar],
    last: Sequence[Scalar],
    raw: Sequence[Scalar],
    weights: Sequence[Scalar],
    law: Law,
    xp: Any,
) -> dict[str, list[Scalar]]:
    """Gains, set-point and their cost; the changes of an episode's first period are free."""
    gains, before = gains_of(raw, xp), ControlState(*control)
    after, setpoint = control_step(before, Errors(*errors), gains, CONTROL_PERIOD, law.limits, xp)
    spans = [o.high - o.low for o in OUTPUTS]
    size = sum(((g - o.low) / s) ** 2 for g, o, s in zip(gains, OUTPUTS, spans, strict=True))
    change = sum(((g - old) / s) ** 2 for g, old, s in zip(gains, last[:6], spans, strict=True))
    moved = ((setpoint.alpha - last[6]) / law.limits.rudder_range) ** 2 + (
        setpoint.throttle - last[7]
    ) ** 2
    cost = weights[4] * size + before.primed * (weights[3] * moved + weights[5] * change)
    return {"control": list(after), "last": [*gains, *setpoint], "cost": [cost]}


def drive(
    actuator: Sequence[Scalar], setpoint: Sequence[Scalar], law: Law, xp: Any
) -> tuple[list[Scalar], list[Scalar]]:
    """Actuator memory after 10 ms, and the simulator's command (rotor speed, rudder)."""
    state, rotor_speed = actuator_step(
        ActuatorState(*actuator), Setpoint(*setpoint), DT, law.limits, xp
    )
    return list(state), [rotor_speed, state.alpha]


SIZES = {
    "motion": len(Motion._fields),
    "guidance": len(GUIDANCE_NAMES),
    "control": len(ControlState._fields),
    "actuator": len(ActuatorState._fields),
    "setpoint": len(SETPOINT_NAMES),
    "last": len(LAST_NAMES),
    "geometry": len(GEOMETRY_NAMES),
    "errors": len(ERROR_NAMES),
    "report": len(REPORT_NAMES),
    "gains": len(OUTPUTS),
}
