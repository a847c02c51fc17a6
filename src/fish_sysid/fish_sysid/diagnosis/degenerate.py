# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Limits in which an effect's parameters are another effect, or none: an answer there is refused.

Every strength has two of them: where it is neutral, and an end of its range, where the optimum lies beyond what the effect can
be. LIMITS declares those that only one effect has.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

from fish_node.pool import LENGTH, WIDTH
from fish_sim.effects import EFFECTS
from fish_sysid.estimation.parametrization import EffectTable, effect_class, scale_of

Values = Mapping[str, float]
Limit = tuple[str, Callable[[Values], bool]]  # what it is there, and whether it is there

AT_AN_END = 0.02  # of a range, or of a typical strength from neutral
MARGIN = 0.1  # m beyond a wall at which a line may be made fast
SLOWEST_WAVE = 0.1  # Hz; slower than this a wave is a constant force in a trial
FARTHEST_WALL = 1.0  # m; drag that falls off more slowly is larger in the whole pool
WIDEST_HUMP = 0.3  # m/s
LONGEST_WAKE, SHORTEST_WAKE = 5.0, 0.025  # s
SLOWEST_BATTERY = 100.0  # s

# of each effect that is another one in a limit: what it is there, and the parameters that say so
LIMITS: dict[str, tuple[Limit, ...]] = {
    "tether": (
        (
            "its line is made fast outside the pool: a constant force in the pool frame",
            lambda p: abs(p["x"]) > LENGTH / 2 + MARGIN or abs(p["y"]) > WIDTH / 2 + MARGIN,
        ),
    ),
    "sloshing": (
        ("so slow a wave is a constant force in the pool frame", lambda p: p["frequency"] < SLOWEST_WAVE),
    ),
    "wall_effect": (
        ("it reaches over the whole pool: a larger drag everywhere", lambda p: p["length"] > FARTHEST_WALL),
    ),
    "wave_drag": (("so wide a hump is drag at every speed", lambda p: p["width"] > WIDEST_HUMP),),
    "wake_memory": (
        ("without a share that follows late it is tip_slip", lambda p: p["share"] < AT_AN_END),
        ("so long a memory is tip_slip with more grip", lambda p: p["time_constant"] > LONGEST_WAKE),
        ("so short a memory is tip_slip", lambda p: p["time_constant"] < SHORTEST_WAKE),
    ),
    "battery_sag": (
        ("so slow a sag is a constant gain of the rotor", lambda p: p["time_constant"] > SLOWEST_BATTERY),
    ),
}  # fmt: skip


def degenerate(name: str, values: Values, effects: EffectTable = EFFECTS) -> str:
    """Why these values (of some or all parameters) are not this effect; "" where they are."""
    for text, is_there in LIMITS.get(name, ()):
        try:
            if is_there(values):
                return f"{name}: {text}"
        except KeyError:  # the parameters that would say so were not estimated
            continue
    effect, at_neutral = effect_class(name, effects), []
    for key in effect.strength:
        if key not in values:
            continue
        p, value = effect.parameters[key], values[key]
        near = AT_AN_END * scale_of(p)
        if not p.lowest - near <= value <= p.highest + near:
            return f"{name}: {key} is out of its range ({value:.3g} {p.unit})"
        if p.value not in (p.lowest, p.highest) and min(value - p.lowest, p.highest - value) < near:
            return f"{name}: {key} is at an end of its range ({value:.3g} {p.unit})"
        if p.value == p.lowest and p.highest - value < near:
            return f"{name}: {key} is at the upper end of its range ({value:.3g} {p.unit})"
        at_neutral.append(abs(value - p.value) < near)
    if at_neutral and all(at_neutral):
        return f"{name}: its strength is that of no such effect"
    return ""
