# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What can be concealed in the second plant: things of its own engine, and the vocabulary's names that mean the same."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Concealed:
    """A change of the plant. names: what would be right in the vocabulary; empty: no name says this."""

    names: tuple[str, ...]
    typical: Mapping[str, float]
    unit: str
    signed: bool = False


CONCEALED: dict[str, Concealed] = {
    "wind": Concealed(
        ("current",), {"x": 0.03, "y": -0.02}, "m/s, velocity of the medium", signed=True
    ),
    "servo_filter": Concealed(
        ("rudder_lag",), {"time": 0.12}, "s, filter before the position servo"
    ),
    "servo_trim": Concealed(
        ("rudder_offset",), {"angle": 0.06}, "rad, zero of the position servo", signed=True
    ),
    "image_age": Concealed(("camera_latency",), {"delay": 0.05}, "s"),
    "ballast": Concealed(
        ("payload",), {"mass": 0.06, "forward": 0.04, "left": 0.02}, "kg, m, m; rigid on the head"
    ),
    "joint_damping": Concealed(
        ("tail_joint_damping",), {"c": 1e-3}, "N m s/rad in every tail joint"
    ),
    "joint_friction": Concealed((), {"loss": 1.5e-3}, "N m of dry friction in every tail joint"),
    "viscosity": Concealed((), {"factor": 300.0}, "times the viscosity of water"),
}
ORDER = ("", *CONCEALED)  # "" conceals nothing
# of a pair of days: what a name of the vocabulary says, alone and two at once
CHANGES: tuple[tuple[str, ...], ...] = (
    ("wind",),
    ("servo_filter",),
    ("servo_trim",),
    ("wind", "servo_trim"),
    ("image_age",),
    ("ballast",),
    ("joint_damping",),
    ("image_age", "joint_damping"),
    ("ballast", "wind"),
)


def draw(number: int, random: np.random.Generator) -> tuple[str, dict[str, float]]:
    """(name or "", values) of scenario `number`."""
    name = ORDER[number % len(ORDER)]
    return name, drawn(name, random) if name else {}


def drawn(name: str, random: np.random.Generator) -> dict[str, float]:
    """Values near the typical ones, of either sign where a sign is possible."""
    concealed = CONCEALED[name]
    sign = float(random.choice([-1.0, 1.0])) if concealed.signed else 1.0
    factor = sign * random.uniform(0.85, 1.15)
    return {k: float(factor * v) for k, v in concealed.typical.items()}
