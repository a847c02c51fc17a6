# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The hull: drag beyond the nominal one, a shape that is not quite symmetric, and what is tied to the head."""

from typing import Any

from fish_sim.effects.effect import BodyMotion, Drive, Effect, Values, Wrench
from fish_sim.ops import Scalar
from fish_sim.parameter import Parameter


class QuadraticDrag(Effect):
    """Pressure drag of the hull grows with the square of its speed through the water.

        X = -k_u |u| u,   Y = -k_v |v| v,   N = -k_r |r| r

    Frame: base_link; u, v [m/s] relative to the water, r [rad/s].
    """

    name = "quadratic_drag"
    kind = "physics"
    equation = "X = -surge |u| u, Y = -sway |v| v, N = -yaw |r| r on the head"
    source = "Fossen 2021, nonlinear damping: separate quadratic terms per direction; strengths are an assumption"
    parameters = {
        "surge": Parameter(0.0, "N s^2/m^2", 0.0, 20.0, source, typical=0.6),
        "sway": Parameter(0.0, "N s^2/m^2", 0.0, 100.0, source, typical=4.0),
        "yaw": Parameter(0.0, "N m s^2", 0.0, 0.1, source, typical=1.2e-3),
    }
    strength = ("surge", "sway", "yaw")
    dissipative = True

    @staticmethod
    def wrench(p: Values, body: BodyMotion, z: Values, drive: Drive, xp: Any) -> Wrench | None:
        if body.name != "head":
            return None
        return (
            -p.surge * xp.fabs(body.u) * body.u,
            -p.sway * xp.fabs(body.v) * body.v,
            -p.yaw * xp.fabs(body.w) * body.w,
        )


WAVE_SMOOTHING = 0.01  # m/s, the force turns over within this speed


class WaveDrag(Effect):
    """Surface waves of the hull cost most at the speed where bow and stern waves add up.

        X = -amplitude exp(-((|u| - speed) / width)^2 / 2) tanh(u / u_0),   u_0 = 0.01 m/s

    Frame: base_link; u [m/s] relative to the water.
    """

    name = "wave_drag"
    kind = "physics"
    equation = "X = -amplitude exp(-((|u| - speed)/width)^2/2) sign(u) on the head"
    source = "assumption: Gaussian hump in place of the wave-resistance curve (Newman 1977)"
    parameters = {
        "amplitude": Parameter(0.0, "N", 0.0, 2.0, source, typical=0.02),
        "speed": Parameter(
            0.22, "m/s", 0.02, 1.0, source, tries=(0.08, 0.12, 0.17, 0.22, 0.28, 0.35)
        ),
        "width": Parameter(0.04, "m/s", 0.005, 0.5, source),
    }
    strength = ("amplitude",)
    dissipative = True

    @staticmethod
    def wrench(p: Values, body: BodyMotion, z: Values, drive: Drive, xp: Any) -> Wrench | None:
        if body.name != "head":
            return None
        off = (xp.fabs(body.u) - p.speed) / p.width
        return -p.amplitude * xp.exp(-0.5 * off**2) * xp.tanh(body.u / WAVE_SMOOTHING), 0.0, 0.0


FRICTION_SMOOTHING = 0.005  # m/s, the force turns over within this speed
TURN_SMOOTHING = 0.05  # rad/s, the moment: the same speed 0.1 m away


class DryFriction(Effect):
    """A force of constant size against the head's way through the water, and a moment of constant size against its turning.

        F = -force tanh(|V| / v_0) V / |V|,   N = -moment tanh(w / w_0)
        V = (u, v),   v_0 = 5 mm/s,   w_0 = 0.05 rad/s

    Frame: base_link; V [m/s] relative to the water, w [rad/s] rate of turn.
    """

    name = "dry_friction"
    kind = "physics"
    equation = "F = -force V/|V| (smooth below 5 mm/s), N = -moment sign(w) (smooth below 0.05 rad/s) on the head"
    source = "Coulomb friction, regularised; strengths are an assumption (surface film, cable)"
    parameters = {
        "force": Parameter(0.0, "N", 0.0, 1.0, source, typical=0.02),
        "moment": Parameter(0.0, "N m", 0.0, 0.05, source, typical=0.001),
    }
    strength = ("force", "moment")
    dissipative = True

    @staticmethod
    def wrench(p: Values, body: BodyMotion, z: Values, drive: Drive, xp: Any) -> Wrench | None:
        if body.name != "head":
            return None
        speed = xp.sqrt(body.u**2 + body.v**2 + (1e-3 * FRICTION_SMOOTHING) ** 2)  # never 0/0
        scale = -p.force * xp.tanh(speed / FRICTION_SMOOTHING) / speed
        return scale * body.u, scale * body.v, -p.moment * xp.tanh(body.w / TURN_SMOOTHING)


class HullAsymmetry(Effect):
    """A crooked hull is pushed to one side and turned by its own way through the water.

        Y = sway u |u|,   N = yaw u |u|

    Frame: base_link, left and counter-clockwise positive; u [m/s] relative to the water.
    """

    name = "hull_asymmetry"
    kind = "physics"
    equation = "Y = sway u|u|, N = yaw u|u| on the head"
    source = "Y_uu, N_uu of an asymmetric hull (Fossen 2021); strengths are an assumption"
    parameters = {
        "sway": Parameter(0.0, "N s^2/m^2", -5.0, 5.0, source, typical=0.15),
        "yaw": Parameter(0.0, "N s^2/m", -0.5, 0.5, source, typical=0.02),
    }
    strength = ("sway", "yaw")

    @staticmethod
    def wrench(p: Values, body: BodyMotion, z: Values, drive: Drive, xp: Any) -> Wrench | None:
        if body.name != "head":
            return None
        pressure = body.u * xp.fabs(body.u)
        return 0.0, p.sway * pressure, p.yaw * pressure


class Payload(Effect):
    """A point mass on the head at (forward, left) of its centre of mass; without added mass or drag."""

    name = "payload"
    kind = "physics"
    equation = "point mass at (forward, left) on the head"
    source = "point mass; strength is an assumption"
    parameters = {
        "mass": Parameter(0.0, "kg", 0.0, 2.0, source, typical=0.06),
        "forward": Parameter(0.04, "m", -0.15, 0.15, source, tries=(-0.04, 0.04)),
        "left": Parameter(0.02, "m", -0.15, 0.15, source, tries=(-0.02, 0.02)),
    }
    strength = ("mass",)

    @staticmethod
    def point_masses(p: Values) -> tuple[tuple[Scalar, Scalar, Scalar], ...]:
        return ((p.mass, p.forward, p.left),)
