# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Missing physics and actuator behaviour, one class per file; the table below is all there is.

Order: physics as in the diagnosis vocabulary; then what happens to a rudder command, and to a rotor command,
on its way: enabled effects act in this order.
"""

from fish_sim.effects.battery_sag import BatterySag
from fish_sim.effects.current import Current
from fish_sim.effects.disturbance import Disturbance
from fish_sim.effects.dry_friction import DryFriction
from fish_sim.effects.effect import Effect
from fish_sim.effects.hull_asymmetry import HullAsymmetry
from fish_sim.effects.nonuniform_current import NonuniformCurrent
from fish_sim.effects.payload import Payload
from fish_sim.effects.quadratic_drag import QuadraticDrag
from fish_sim.effects.rotor_imbalance import RotorImbalance
from fish_sim.effects.rotor_lag import RotorLag
from fish_sim.effects.rotor_saturation import RotorSaturation
from fish_sim.effects.rudder_backlash import RudderBacklash
from fish_sim.effects.rudder_delay import RudderDelay
from fish_sim.effects.rudder_gain import RudderGain
from fish_sim.effects.rudder_lag import RudderLag
from fish_sim.effects.rudder_offset import RudderOffset
from fish_sim.effects.rudder_placement import RudderPlacement
from fish_sim.effects.rudder_saturation import RudderSaturation
from fish_sim.effects.sloshing import Sloshing
from fish_sim.effects.tail_hardening import TailHardening
from fish_sim.effects.tail_joint_damping import TailJointDamping
from fish_sim.effects.tether import Tether
from fish_sim.effects.tip_slip import TipSlip
from fish_sim.effects.wake_memory import WakeMemory
from fish_sim.effects.wall_effect import WallEffect
from fish_sim.effects.wave_drag import WaveDrag

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
