"""A servo that approaches its target gradually."""

from fish_sim.effects.effect import Effect
from fish_sim.parameter import Parameter

SOURCE = "first-order servo; strength is an assumption (hobby servos: 0.02 to 0.15 s)"
SHORTEST = 1e-6  # s, keeps exp(-dt/T) defined at T = 0


class RudderLag(Effect):
    """The servo's target follows the command with a time constant.

        target' = (command - target) / T,   exactly: target += (1 - exp(-dt / T)) (command - target)

    The command is constant over its period dt. The target starts at 0 (centred).
    """

    name = "rudder_lag"
    kind = "actuator"
    equation = "target' = (command - target)/time_constant"
    source = SOURCE
    parameters = {"time_constant": Parameter(0.0, "s", 0.0, 2.0, SOURCE, typical=0.12)}
    strength = ("time_constant",)
    memory = ("target",)

    @staticmethod
    def rudder(p, m, command, dt, xp):
        reached = 1.0 - xp.exp(-dt / xp.fmax(p.time_constant, SHORTEST))
        target = m.target + reached * (command - m.target)
        return target, {"target": target}
