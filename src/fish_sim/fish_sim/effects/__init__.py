# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Missing physics and actuator behaviour, one class each; the table below is all there is.

Order: physics as in the diagnosis vocabulary; then what happens to a rudder command, and to a rotor command,
on its way: enabled effects act in this order.
"""

from fish_sim.effects.effect import Effect
from fish_sim.effects.hull import DryFriction, HullAsymmetry, Payload, QuadraticDrag, WaveDrag
from fish_sim.effects.rotor import BatterySag, RotorImbalance, RotorLag, RotorSaturation
from fish_sim.effects.rudder import (
    RudderBacklash,
    RudderDelay,
    RudderGain,
    RudderLag,
    RudderOffset,
    RudderPlacement,
    RudderSaturation,
)
from fish_sim.effects.surroundings import (
    Current,
    Disturbance,
    NonuniformCurrent,
    Sloshing,
    Tether,
    WallEffect,
)
from fish_sim.effects.tail import TailHardening, TailJointDamping, TipSlip, WakeMemory

EFFECTS: dict[str, type[Effect]] = {
    "quadratic_drag": QuadraticDrag,
    "current": Current,
    "nonuniform_current": NonuniformCurrent,
    "wall_effect": WallEffect,
    "tip_slip": TipSlip,
    "wake_memory": WakeMemory,
    "wave_drag": WaveDrag,
    "sloshing": Sloshing,
    "hull_asymmetry": HullAsymmetry,
    "tail_hardening": TailHardening,
    "tail_joint_damping": TailJointDamping,
    "dry_friction": DryFriction,
    "tether": Tether,
    "payload": Payload,
    "rotor_imbalance": RotorImbalance,
    "disturbance": Disturbance,
    "rudder_gain": RudderGain,
    "rudder_offset": RudderOffset,
    "rudder_saturation": RudderSaturation,
    "rudder_delay": RudderDelay,
    "rudder_backlash": RudderBacklash,
    "rudder_lag": RudderLag,
    "rudder_placement": RudderPlacement,
    "battery_sag": BatterySag,
    "rotor_saturation": RotorSaturation,
    "rotor_lag": RotorLag,
}
