# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The rudder: what servo and linkage make of a command, and where the servo bends the tail."""

from typing import Any

from fish_sim.effects.effect import Effect, Followed, Values
from fish_sim.ops import Scalar
from fish_sim.parameter import Parameter


class RudderGain(Effect):
    """The rudder turns `factor` times as far as the servo: alpha = factor servo. Neutral: 1."""

    name = "rudder_gain"
    kind = "actuator"
    equation = "alpha = factor servo"
    source = "linkage ratio; strength is an assumption"
    parameters = {"factor": Parameter(1.0, "1", 0.0, 3.0, source, typical=0.8)}
    strength = ("factor",)

    has_linkage = True

    @staticmethod
    def linkage(p: Values, m: Values, servo: Scalar, dt: float, xp: Any) -> Followed:
        return p.factor * servo, {}


class RudderOffset(Effect):
    """The rudder stands at a constant angle from the servo: alpha = servo + offset (positive steers left)."""

    name = "rudder_offset"
    kind = "actuator"
    equation = "alpha = servo + offset"
    source = "mounting error, one spline tooth is 0.25 rad; strength is an assumption"
    parameters = {"offset": Parameter(0.0, "rad", -0.8, 0.8, source, typical=0.06)}
    strength = ("offset",)

    has_linkage = True

    @staticmethod
    def linkage(p: Values, m: Values, servo: Scalar, dt: float, xp: Any) -> Followed:
        return servo + p.offset, {}


NO_LIMIT = 1.6  # rad, beyond every admissible rudder range
# rad, tried: a limit above all commands does nothing, so nothing leads from there to one below
LIMITS = (0.06, 0.09, 0.13, 0.18, 0.25, 0.35, 0.5)


class RudderSaturation(Effect):
    """The rudder stops at +-limit inside its nominal range: target = clip(command, -limit, limit).

    At and above the robot's rudder_range the limit does nothing.
    """

    name = "rudder_saturation"
    kind = "actuator"
    equation = "target = clip(command, -limit, limit)"
    source = "end stop or pulse width limit; strength is an assumption"
    parameters = {
        "limit": Parameter(NO_LIMIT, "rad", 0.0, NO_LIMIT, source, typical=0.25, tries=LIMITS)
    }
    strength = ("limit",)

    @staticmethod
    def rudder(p: Values, m: Values, command: Scalar, dt: float, xp: Any) -> Followed:
        return xp.fmax(-p.limit, xp.fmin(command, p.limit)), {}


LENGTH = 30  # commands remembered: 0.3 s at 10 ms


class RudderDelay(Effect):
    """The servo executes the command given `delay` ago.

        target(k) = command(k) + sum_j clip(delay / dt - j, 0, 1) (command(k - j - 1) - command(k - j)),   j = 0, 1, ...

    A fractional delay interpolates linearly between past commands. Commands before the start are 0 (centred). Nothing is clipped
    at the ends of the delay's range: at 0, where searches stand, half of the derivative would be lost.
    """

    name = "rudder_delay"
    kind = "actuator"
    equation = "target(t) = command(t - delay)"
    source = "transport delay of radio and servo loop; strength is an assumption"
    # the upper limit is what LENGTH commands of 10 ms can hold; the typical value is off the grid of 10 ms
    parameters = {"delay": Parameter(0.0, "s", 0.0, 0.3, source, typical=0.085)}
    strength = ("delay",)
    memory = tuple(f"past_{j}" for j in range(1, LENGTH + 1))

    @staticmethod
    def rudder(p: Values, m: Values, command: Scalar, dt: float, xp: Any) -> Followed:
        commands = [command, *(getattr(m, key) for key in RudderDelay.memory)]
        target = command
        for j in range(LENGTH):
            share = p.delay / dt - j
            share = share if j == 0 else xp.fmax(share, 0.0)
            share = share if j == LENGTH - 1 else xp.fmin(share, 1.0)
            target = target + share * (commands[j + 1] - commands[j])
        return target, dict(zip(RudderDelay.memory, commands, strict=False))


class RudderBacklash(Effect):
    """The rudder is dragged along by the servo with free play of half-width `play` either side.

        alpha <- max(servo - play, min(servo + play, alpha))

    It starts at 0 (centred). Without play, where searches stand, all three are one, and the derivative is that of a rudder
    that is dragged along.
    """

    name = "rudder_backlash"
    kind = "actuator"
    equation = "alpha = clip(alpha, servo - play, servo + play)"
    source = "play operator (Visintin 1994); strength is an assumption"
    parameters = {"play": Parameter(0.0, "rad", 0.0, 0.8, source, typical=0.06)}
    strength = ("play",)
    has_linkage = True
    memory = ("dragged",)

    @staticmethod
    def linkage(p: Values, m: Values, servo: Scalar, dt: float, xp: Any) -> Followed:
        ahead, behind = servo - p.play, servo + p.play
        dragged = xp.where(
            m.dragged < ahead, ahead, xp.where(m.dragged > behind, behind, m.dragged)
        )
        return dragged, {"dragged": dragged}


SHORTEST = 1e-6  # s, keeps exp(-dt/T) defined at T = 0


class RudderLag(Effect):
    """The servo approaches its target with a time constant, at most at its rate limit.

    alpha' = (target - alpha) / T,   exactly over a period dt: alpha += (1 - exp(-dt / T)) (target - alpha)
    """

    name = "rudder_lag"
    kind = "actuator"
    equation = "alpha' = (command - alpha)/time_constant, at most the servo's rate limit"
    source = "first-order servo; strength is an assumption (hobby servos: 0.02 to 0.15 s)"
    parameters = {"time_constant": Parameter(0.0, "s", 0.0, 2.0, source, typical=0.12)}
    strength = ("time_constant",)

    @staticmethod
    def servo(p: Values, alpha: Scalar, target: Scalar, dt: float, xp: Any) -> Scalar:
        return alpha + (1.0 - xp.exp(-dt / xp.fmax(p.time_constant, SHORTEST))) * (target - alpha)


class RudderPlacement(Effect):
    """A share of alpha turns the fin at the tip, the rest the root of the tail.

        rest of joint 1 = -(1 - tip_share) alpha,   direction of the fin = theta_n - tip_share alpha

    The reaction to alpha'' is neglected (light servo).
    """

    name = "rudder_placement"
    kind = "actuator"
    equation = (
        "joint 1 rests at -(1 - tip_share) alpha, the fin points along theta_n - tip_share alpha"
    )
    source = "the project's model description: root of the tail (nominal) or fin at the tip"
    parameters = {"tip_share": Parameter(0.0, "1", 0.0, 1.0, source, typical=0.6)}
    strength = ("tip_share",)

    @staticmethod
    def tip_share(p: Values) -> Scalar:
        return p.tip_share
