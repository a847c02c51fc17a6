# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Families of names that recordings often cannot tell apart, and the manoeuvre that separates their members."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from fish_sysid.diagnosis.next_experiment import (
    CIRCLES,
    COAST,
    RUDDER_STEPS,
    STROKES,
    Plan,
    written,
)

FAMILIES: dict[str, tuple[tuple[str, ...], Plan]] = {
    "rudder timing": (
        ("rudder_lag", "rudder_delay", "rudder_backlash", "rudder_saturation", "rudder_gain", "rudder_placement"),
        RUDDER_STEPS,
    ),
    "rudder zero": (("rudder_offset", "camera_heading_offset", "hull_asymmetry"), CIRCLES),
    "heavier head": (("payload", "rotor_imbalance"), STROKES),
    "tail losses": (("tail_joint_damping", "tip_slip", "wake_memory", "tail_hardening"), STROKES),
    "flow": (("current", "nonuniform_current", "tether", "sloshing"), CIRCLES),
    "drags": (("quadratic_drag", "dry_friction", "wave_drag", "wall_effect"), COAST),
    "clocks": (("camera_latency", "imu_latency"), RUDDER_STEPS),
    "motor": (("rotor_lag", "rotor_saturation", "battery_sag"), STROKES),
}  # fmt: skip


def family_of(name: str) -> str:
    """The family of a name; "" for one that stands alone."""
    return next((family for family, (members, _) in FAMILIES.items() if name in members), "")


def separating(families: Sequence[Sequence[str]]) -> dict[str, Any] | None:
    """The manoeuvre that tells the members of the first of these families apart; None where no name has a rival in its family."""
    for members in families:
        family = family_of(members[0]) if members else ""
        kin = [name for name in members if family_of(name) == family]
        if family and len(kin) > 1:
            why, program = FAMILIES[family][1]
            return written(f"tell {', '.join(kin)} apart: {why}", program)
    return None
