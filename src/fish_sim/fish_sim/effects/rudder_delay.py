"""A servo that hears its commands late."""

from typing import Any

from fish_sim.effects.effect import Effect, Followed, Values
from fish_sim.ops import Scalar
from fish_sim.parameter import Parameter

SOURCE = "transport delay of radio and servo loop; strength is an assumption"
LENGTH = 30  # commands remembered: 0.3 s at 10 ms


class RudderDelay(Effect):
    """The servo executes the command given `delay` ago.

        target(k) = sum_j hat(delay / dt - j) command(k - j),   hat(a) = max(0, 1 - |a|)

    A fractional delay interpolates linearly between past commands. Commands before the start are 0 (centred).
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
        periods = p.delay / dt
        target = sum(xp.fmax(0.0, 1.0 - xp.fabs(periods - j)) * c for j, c in enumerate(commands))
        return target, dict(zip(RudderDelay.memory, commands, strict=False))
