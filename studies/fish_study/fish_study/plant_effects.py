# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Effects that a plant may have and the tool's table EFFECTS does not hold.

OTHER_FORMS: physics that the vocabulary names, in a form other than the tool's own candidate; the right answer is that name.
OUTSIDE: physics that the vocabulary has no name for; the right answer to each is `unexplained`, or `no_mismatch` where too
weak to see; any name is a wrong name.
"""

from __future__ import annotations

from typing import Any

from fish_sim.effects import EFFECTS
from fish_sim.effects.effect import BodyMotion, Drive, Effect, Flow, Values, Wrench
from fish_sim.ops import Scalar
from fish_sim.parameter import Parameter

VORTEX_SOURCE = "Taylor vortex (Saffman 1992, Vortex Dynamics, ch. 13); strengths are an assumption"
SOURCE = "invented for the blind study; not in the vocabulary"


class Vortex(Effect):
    """One vortex somewhere in the pool: V_t = speed (r / core) exp((1 - r^2 / core^2) / 2) about (at_x, at_y).

    r [m]: distance from its middle, where the water rests; `speed` is reached at r = core. Frame: pool.
    """

    name = "vortex"
    kind = "physics"
    equation = "V_t = speed (r/core) exp((1 - r^2/core^2)/2) about (at_x, at_y)"
    source = VORTEX_SOURCE
    parameters = {
        "speed": Parameter(0.0, "m/s", -0.5, 0.5, VORTEX_SOURCE, typical=0.04),
        "at_x": Parameter(0.3, "m", -2.0, 2.0, VORTEX_SOURCE),
        "at_y": Parameter(0.2, "m", -1.0, 1.0, VORTEX_SOURCE),
        "core": Parameter(0.5, "m", 0.05, 2.0, VORTEX_SOURCE),
    }
    strength = ("speed",)

    @staticmethod
    def water(p: Values, x: Scalar, y: Scalar, z: Values, xp: Any) -> Flow:
        dx, dy, k = x - p.at_x, y - p.at_y, 1.0 / p.core**2
        turn = p.speed / p.core * xp.exp(0.5 * (1.0 - k * (dx**2 + dy**2)))
        gradient = (
            (turn * k * dx * dy, turn * (k * dy**2 - 1.0)),
            (turn * (1.0 - k * dx**2), -turn * k * dx * dy),
        )
        return (-turn * dy, turn * dx), gradient


OTHER_FORMS: dict[str, type[Effect]] = {"vortex": Vortex}
MEANS = {"vortex": "nonuniform_current"}


class StrokeAsymmetry(Effect):
    """The rotor pushes the head harder in one direction of its stroke than in the other.

    N = -inertia |phi''|        phi'' [rad/s^2] the rotor's acceleration, inertia [kg m^2]
    """

    name = "stroke_asymmetry"
    kind = "physics"
    equation = "N = -inertia |rotor acceleration| on the head"
    source = SOURCE
    parameters = {"inertia": Parameter(0.0, "kg m^2", 0.0, 1e-3, SOURCE, typical=8e-6)}
    strength = ("inertia",)

    @staticmethod
    def wrench(p: Values, body: BodyMotion, z: Values, drive: Drive, xp: Any) -> Wrench | None:
        if body.name != "head":
            return None
        return 0.0, 0.0, -p.inertia * xp.fabs(drive.rotor_acceleration)


class RotorDrag(Effect):
    """The rotor stirs the water inside a flooded hull: N = -k |phi'| phi' on the head.

    phi' [rad/s] the rotor's speed; k [N m s^2].
    """

    name = "rotor_drag"
    kind = "physics"
    equation = "N = -k |rotor speed| rotor speed on the head"
    source = SOURCE
    parameters = {"k": Parameter(0.0, "N m s^2", 0.0, 1e-4, SOURCE, typical=4e-6)}
    strength = ("k",)

    @staticmethod
    def wrench(p: Values, body: BodyMotion, z: Values, drive: Drive, xp: Any) -> Wrench | None:
        if body.name != "head":
            return None
        return 0.0, 0.0, -p.k * xp.fabs(drive.rotor_speed) * drive.rotor_speed


class GrowingDrag(Effect):
    """Something sticks to the hull and grows during a trial: X = -rate t u, Y = -3 rate t v.

    t [s] since the start of the trial; rate [N/m].
    """

    name = "growing_drag"
    kind = "physics"
    equation = "X = -rate t u, Y = -3 rate t v on the head"
    source = SOURCE
    parameters = {"rate": Parameter(0.0, "N/m", 0.0, 1.0, SOURCE, typical=0.025)}
    strength = ("rate",)
    states = ("time",)

    @staticmethod
    def wrench(p: Values, body: BodyMotion, z: Values, drive: Drive, xp: Any) -> Wrench | None:
        if body.name != "head":
            return None
        return -p.rate * z.time * body.u, -3.0 * p.rate * z.time * body.v, 0.0

    @staticmethod
    def derivative(p: Values, z: Values, slip: Scalar, drive: Drive, xp: Any) -> tuple[Scalar, ...]:
        return (1.0,)


class RudderInducedDrag(Effect):
    """A deflected tail costs thrust: X = -k alpha^2 u.

    alpha [rad] rudder, u [m/s] surge through the water, k [N s/m].
    """

    name = "rudder_induced_drag"
    kind = "physics"
    equation = "X = -k alpha^2 u on the head"
    source = SOURCE
    parameters = {"k": Parameter(0.0, "N s/m", 0.0, 50.0, SOURCE, typical=1.5)}
    strength = ("k",)

    @staticmethod
    def wrench(p: Values, body: BodyMotion, z: Values, drive: Drive, xp: Any) -> Wrench | None:
        return (-p.k * drive.alpha**2 * body.u, 0.0, 0.0) if body.name == "head" else None


class Compass(Effect):
    """The motor's magnets feel the earth's field or the steel in the floor: N = moment sin(course - heading)."""

    name = "compass"
    kind = "physics"
    equation = "N = x sin-part + y cos-part of the heading: N = y cos(heading) - x sin(heading) on the head"
    source = SOURCE
    parameters = {
        "x": Parameter(0.0, "N m", -0.1, 0.1, SOURCE, typical=1.0e-3),
        "y": Parameter(0.0, "N m", -0.1, 0.1, SOURCE, typical=-8e-4),
    }
    strength = ("x", "y")

    @staticmethod
    def wrench(p: Values, body: BodyMotion, z: Values, drive: Drive, xp: Any) -> Wrench | None:
        return (0.0, 0.0, p.y * body.cos - p.x * body.sin) if body.name == "head" else None


class Jet(Effect):
    """An inlet in the wall pushes the fish where its jet is: F = (x, y) exp(-d^2 / 2 width^2), pool frame."""

    name = "jet"
    kind = "physics"
    equation = "F = (x, y) exp(-d^2/(2 width^2)), d the distance of the head from (at_x, at_y)"
    source = SOURCE
    parameters = {
        "x": Parameter(0.0, "N", -1.0, 1.0, SOURCE, typical=0.03),
        "y": Parameter(0.0, "N", -1.0, 1.0, SOURCE, typical=0.04),
        "at_x": Parameter(0.3, "m", -2.0, 2.0, SOURCE),
        "at_y": Parameter(0.2, "m", -1.0, 1.0, SOURCE),
        "width": Parameter(0.3, "m", 0.05, 2.0, SOURCE),
    }
    strength = ("x", "y")

    @staticmethod
    def wrench(p: Values, body: BodyMotion, z: Values, drive: Drive, xp: Any) -> Wrench | None:
        if body.name != "head":
            return None
        squared = (body.x - p.at_x) ** 2 + (body.y - p.at_y) ** 2
        strength = xp.exp(-squared / (2.0 * p.width**2))
        fx, fy = p.x * strength, p.y * strength
        return fx * body.cos + fy * body.sin, fy * body.cos - fx * body.sin, 0.0


class TurningThrust(Effect):
    """The hull banks in a turn and the keel pushes it inwards: Y = k |r| r u.

    r [rad/s] yaw rate, u [m/s] surge, k [N s^3/(m rad^2)].
    """

    name = "turning_thrust"
    kind = "physics"
    equation = "Y = k |r| r u on the head"
    source = SOURCE
    parameters = {"k": Parameter(0.0, "N s^3/m", 0.0, 10.0, SOURCE, typical=0.12)}
    strength = ("k",)

    @staticmethod
    def wrench(p: Values, body: BodyMotion, z: Values, drive: Drive, xp: Any) -> Wrench | None:
        return (0.0, p.k * xp.fabs(body.w) * body.w * body.u, 0.0) if body.name == "head" else None


OUTSIDE: dict[str, type[Effect]] = {
    effect.name: effect
    for effect in (
        StrokeAsymmetry,
        RotorDrag,
        GrowingDrag,
        RudderInducedDrag,
        Compass,
        Jet,
        TurningThrust,
    )
}

PLANT_EFFECTS = {**EFFECTS, **OUTSIDE, **OTHER_FORMS}  # what a plant, but not the tool, may have
