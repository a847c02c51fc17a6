"""Drag that does not depend on speed."""

from typing import Any

from fish_sim.effects.effect import BodyMotion, Drive, Effect, Values, Wrench
from fish_sim.parameter import Parameter

SOURCE = "Coulomb friction, regularised; strength is an assumption (surface film, cable)"
SMOOTHING = 0.005  # m/s, the force turns over within this speed


class DryFriction(Effect):
    """A force of constant size against the head's way through the water.

        F = -force tanh(|V| / v_0) V / |V|,   V = (u, v),   v_0 = 5 mm/s

    Frame: base_link; V [m/s] relative to the water.
    """

    name = "dry_friction"
    kind = "physics"
    equation = "F = -force V/|V| on the head (smooth below 5 mm/s)"
    source = SOURCE
    parameters = {"force": Parameter(0.0, "N", 0.0, 1.0, SOURCE, typical=0.02)}
    strength = ("force",)
    dissipative = True

    @staticmethod
    def wrench(p: Values, body: BodyMotion, z: Values, drive: Drive, xp: Any) -> Wrench | None:
        if body.name != "head":
            return None
        speed = xp.sqrt(body.u**2 + body.v**2 + (1e-3 * SMOOTHING) ** 2)  # never 0/0
        scale = -p.force * xp.tanh(speed / SMOOTHING) / speed
        return scale * body.u, scale * body.v, 0.0
