# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The rotor: what motor and battery make of a speed command, and a rotor whose centre of mass is off its axis."""

import math
from collections.abc import Mapping
from typing import Any

from fish_sim.effects.effect import BodyMotion, Drive, Effect, Followed, Values, Wrench
from fish_sim.ops import Scalar
from fish_sim.parameter import Parameter

REFERENCE_SPEED = 100.0  # rad/s, load 1


class BatterySag(Effect):
    """The rotor turns slower than commanded by what the load takes from the voltage.

        speed = command max(0, 1 - sag load),   load' = ((command / 100 rad/s)^2 - load) / time_constant

    The load is the smoothed square of the commanded speed, 0 at the start; a long time constant means running down.
    """

    name = "battery_sag"
    kind = "actuator"
    equation = (
        "speed = command (1 - sag load), load' = ((command/100 rad/s)^2 - load)/time_constant"
    )
    source = (
        "first-order (Thevenin) battery, speed proportional to voltage; strengths are an assumption"
    )
    parameters = {
        "sag": Parameter(0.0, "1", 0.0, 2.0, source, typical=0.2),
        "time_constant": Parameter(1.0, "s", 0.02, 1000.0, source),
    }
    strength = ("sag",)
    memory = ("load",)

    @staticmethod
    def rotor(p: Values, m: Values, command: Scalar, dt: float, xp: Any) -> Followed:
        reached = 1.0 - xp.exp(-dt / p.time_constant)
        load = m.load + reached * ((command / REFERENCE_SPEED) ** 2 - m.load)
        return command * xp.fmax(0.0, 1.0 - p.sag * load), {"load": load}


NO_LIMIT = 1000.0  # rad/s, far above every commanded speed (nominal maximum 151 rad/s)
# rad/s, tried: a limit above all commands does nothing, so nothing leads from there to one below
LIMITS = (20.0, 25.0, 32.0, 40.0, 50.0, 63.0, 79.0, 99.0, 124.0)


class RotorSaturation(Effect):
    """The rotor does not exceed a speed: speed = clip(command, -limit, limit)."""

    name = "rotor_saturation"
    kind = "actuator"
    equation = "speed = clip(command, -limit, limit)"
    source = "no-load speed at the given voltage; strength is an assumption"
    parameters = {
        "limit": Parameter(NO_LIMIT, "rad/s", 0.0, NO_LIMIT, source, typical=70.0, tries=LIMITS)
    }
    strength = ("limit",)

    @staticmethod
    def rotor(p: Values, m: Values, command: Scalar, dt: float, xp: Any) -> Followed:
        return xp.fmax(-p.limit, xp.fmin(command, p.limit)), {}


SHORTEST = 1e-6  # s, keeps exp(-dt/T) defined at T = 0


class RotorLag(Effect):
    """The rotor's speed follows the nominal course, linear between commands, with a time constant.

        speed' = (c(t) - speed) / T,   c(t) = c_0 + a t,   a = (c_1 - c_0) / dt

    Exactly over one period: speed_1 = c_1 - a T + (speed_0 - c_0 + a T) exp(-dt / T). Starts at rest.
    """

    name = "rotor_lag"
    kind = "actuator"
    equation = "speed' = (command - speed)/time_constant"
    source = "first-order speed loop; strength is an assumption"
    parameters = {"time_constant": Parameter(0.0, "s", 0.0, 2.0, source, typical=0.03)}
    strength = ("time_constant",)
    memory = ("speed", "command")

    @staticmethod
    def rotor(p: Values, m: Values, command: Scalar, dt: float, xp: Any) -> Followed:
        behind = p.time_constant * (command - m.command) / dt
        kept = xp.exp(-dt / xp.fmax(p.time_constant, SHORTEST))
        speed = command - behind + (m.speed - m.command + behind) * kept
        return speed, {"speed": speed, "command": command}


class RotorImbalance(Effect):
    """The centrifugal and tangential reaction of the eccentric rotor on the head.

        F = (r + phi')^2 R(phi) m - phi'' R(phi) m_perp,   m = (ahead, left),   m_perp = (-left, ahead)

    m [kg m]: mass times eccentricity at rotor angle 0, base_link axes; R(phi) turns by the rotor's angle phi,
    which is 0 at the start. The axis is at the head's centre of mass. Neglected: r' in the tangential term
    (|r'| is below 5 % of |phi''|) and the recoil's moment about the axis.
    """

    name = "rotor_imbalance"
    kind = "physics"
    equation = "F = (r + phi')^2 R(phi) m - phi'' R(phi) m_perp on the head, m = (ahead, left)"
    source = "rigid-body dynamics of an eccentric rotor; strength is an assumption"
    parameters = {
        "ahead": Parameter(0.0, "kg m", -1e-2, 1e-2, source, typical=6e-5),
        "left": Parameter(0.0, "kg m", -1e-2, 1e-2, source, typical=3e-5),
    }
    strength = ("ahead", "left")
    states = ("angle",)

    @staticmethod
    def wrench(p: Values, body: BodyMotion, z: Values, drive: Drive, xp: Any) -> Wrench | None:
        if body.name != "head":
            return None
        cos, sin = xp.cos(z.angle), xp.sin(z.angle)
        ahead, left = p.ahead * cos - p.left * sin, p.ahead * sin + p.left * cos
        spin = (body.w + drive.rotor_speed) ** 2
        push = drive.rotor_acceleration
        return spin * ahead + push * left, spin * left - push * ahead, 0.0

    @staticmethod
    def derivative(p: Values, z: Values, slip: Scalar, drive: Drive, xp: Any) -> tuple[Scalar, ...]:
        return (drive.rotor_speed,)

    @staticmethod
    def derived(p: Values) -> Mapping[str, tuple[float, str]]:
        return {
            "mass_eccentricity": (math.hypot(p.ahead, p.left), "kg m"),
            "phase": (math.atan2(p.left, p.ahead), "rad"),
        }
