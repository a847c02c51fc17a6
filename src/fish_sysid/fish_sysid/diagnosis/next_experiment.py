# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Which manoeuvre would separate what the data could not: a program the simulator and the robot can run."""

from __future__ import annotations

from typing import Any

Plan = tuple[str, list[tuple[float, float, float, float]]]  # why; s, rad, Hz, rad

STRAIGHT_STEPS: Plan = (
    "straight runs at several speeds",
    [(0, 6, 2, 0), (10, 8, 2, 0), (20, 10, 2, 0), (30, 11.5, 2, 0)],
)
RUDDER_STEPS: Plan = (
    "rudder steps of several sizes: lag, delay, backlash, offset and gain answer differently",
    [
        (0, 8, 2, 0),
        (4, 8, 2, 0.1),
        (8, 8, 2, -0.1),
        (12, 8, 2, 0.4),
        (16, 8, 2, -0.4),
        (20, 8, 2, 0.8),
        (24, 8, 2, -0.8),
    ],
)
CIRCLES: Plan = (
    "slow circles both ways: a current drifts them, an asymmetry or an offset makes the two unequal",
    [(0, 7, 2, 0.5), (20, 7, 2, -0.5)],
)
STROKES: Plan = (
    "strokes at several frequencies: tail stiffness, damping, slip and wake differ in their phase",
    [(0, 9, 1.2, 0), (8, 9, 2, 0), (16, 8, 2.8, 0), (24, 9, 2, 0.4)],
)
COAST: Plan = (
    "swim fast, then let it coast: drag laws differ at the end",
    [(0, 11, 2, 0), (8, 0, 2, 0), (20, 11, 2, 0), (28, 0, 2, 0)],
)

PLANS = {
    **dict.fromkeys(("quadratic_drag", "dry_friction", "wave_drag", "payload"), COAST),
    **dict.fromkeys(("current", "nonuniform_current", "hull_asymmetry", "tether"), CIRCLES),
    **dict.fromkeys(("camera_heading_offset", "camera_scale", "gyro_scale"), CIRCLES),
    **dict.fromkeys(
        (
            "tip_slip",
            "wake_memory",
            "tail_hardening",
            "tail_joint_damping",
            "rotor_imbalance",
            "rotor_lag",
        ),
        STROKES,
    ),
}


# what shows best where a force without a name grows, by the covariate that it depends on most
UNEXPLAINED_PLANS = {
    "surge_speed": STRAIGHT_STEPS,
    "rotor_speed": STROKES,
    "rudder": RUDDER_STEPS,
}  # turning, heading and place: CIRCLES


def next_experiment(
    found: list[str], rivals: list[str], grows_with: str | None = None
) -> dict[str, Any]:
    """The manoeuvre that tells the found effects from their rivals; without rivals, one that tightens the estimate.

    grows_with: covariate of a force that no name explains, if there is one and no effect was found.
    """
    names = rivals or found
    if not names and grows_with is None:
        why, program = (
            "nothing was found missing; to see more, swim faster than these data do: "
            + STRAIGHT_STEPS[0],
            STRAIGHT_STEPS[1],
        )
    elif not names:
        plan = UNEXPLAINED_PLANS.get(str(grows_with), CIRCLES)
        why, program = (
            f"see on what the unexplained force depends besides {grows_with}: {plan[0]}",
            plan[1],
        )
    else:
        plan = PLANS.get(
            names[0], RUDDER_STEPS if names[0].startswith("rudder") else STRAIGHT_STEPS
        )
        aim = (
            f"tell {', '.join(found)} from {', '.join(rivals)}"
            if rivals
            else f"tighten {', '.join(found)}"
        )
        why, program = f"{aim}: {plan[0]}", plan[1]
    return written(why, program)


def written(why: str, program: list[tuple[float, float, float, float]]) -> dict[str, Any]:
    """A plan as diagnosis.json has it, which `robofish excite` swims."""
    keys = ("t", "amplitude", "frequency", "rudder")
    return {
        "why": why,
        "program": [dict(zip(keys, map(float, row), strict=True)) for row in program],
    }
