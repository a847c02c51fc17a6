# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""A servo that hears its commands late."""

from typing import Any

from fish_sim.effects.effect import Effect, Followed, Values
from fish_sim.ops import Scalar
from fish_sim.parameter import Parameter

SOURCE = "transport delay of radio and servo loop; strength is an assumption"
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
    source = SOURCE
    # the upper limit is what LENGTH commands of 10 ms can hold; the typical value is off the grid of 10 ms
    parameters = {"delay": Parameter(0.0, "s", 0.0, 0.3, SOURCE, typical=0.085)}
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
