"""A force without a name: what the fish did, its squares and products, each with a free coefficient on each degree of freedom.

Written as an effect, so that the filter has the derivative of every innovation with respect to every coefficient. It is
no candidate: a name says more than a list of coefficients.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from itertools import combinations
from typing import Any

from fish_sim.effects import EFFECTS
from fish_sim.effects.effect import BodyMotion, Drive, Effect, Values, Wrench
from fish_sim.ops import NUMPY, Scalar
from fish_sim.parameter import Parameter
from fish_sim.pool import LENGTH, WIDTH
from fish_sysid.diagnosis.latent_force import DOFS

WALL = 0.2  # m, over which a wall is felt
FREE = 1e6  # bounds of a coefficient: none


def regressors(body: BodyMotion, time: Scalar, drive: Drive, xp: Any) -> dict[str, Scalar]:
    """Terms of a law in SI units: motion and inputs, signed squares, products, heading and place, what grows during a trial."""
    base = {
        "surge_speed": body.u,
        "sway_speed": body.v,
        "yaw_rate": body.w,
        "rudder": drive.alpha,
        "rotor_speed": drive.rotor_speed,
    }
    terms = dict(base)
    terms |= {f"{k} |{k}|": v * xp.fabs(v) for k, v in base.items()}
    terms |= {f"{a} {b}": base[a] * base[b] for a, b in combinations(base, 2)}
    terms |= {"cos(heading)": body.cos, "sin(heading)": body.sin}
    terms |= {"x": body.x, "y": body.y, "time": time}
    terms |= {f"time {k}": time * base[k] for k in ("surge_speed", "sway_speed", "yaw_rate")}
    terms["surge_speed rudder^2"] = body.u * drive.alpha * drive.alpha
    gap = xp.fmin(LENGTH / 2 - xp.fabs(body.x), WIDTH / 2 - xp.fabs(body.y))
    terms[f"surge_speed exp(-wall_distance/{WALL} m)"] = body.u * xp.exp(-gap / WALL)
    return terms


TERMS = tuple(regressors(BodyMotion("head", *[1.0] * 10), 1.0, Drive(*[1.0] * 4), NUMPY))
COEFFICIENTS = tuple(f"{dof}_{j}" for dof in DOFS for j in range(len(TERMS)))


class FreeForce(Effect):
    """(X, Y, N)_i = sum_j c_ij term_j on the head, term_j of `regressors`; t [s] since the start of the trial is a state.

    All coefficients 0 is the nominal model, to which the force is the first-order change.
    """

    name = "free_force"
    kind = "physics"
    equation = "(X, Y, N)_i = sum_j c_ij term_j on the head"
    source = "a linear combination of what a force may depend on"
    parameters = dict.fromkeys(COEFFICIENTS, Parameter(0.0, "SI", -FREE, FREE))
    strength = COEFFICIENTS
    states = ("time",)

    @staticmethod
    def wrench(p: Values, body: BodyMotion, z: Values, drive: Drive, xp: Any) -> Wrench | None:
        if body.name != "head":
            return None
        terms = list(regressors(body, z.time, drive, xp).values())
        x, y, n = (
            sum(getattr(p, f"{dof}_{j}") * term for j, term in enumerate(terms)) for dof in DOFS
        )
        return x, y, n

    @staticmethod
    def derivative(p: Values, z: Values, slip: Scalar, drive: Drive, xp: Any) -> tuple[Scalar, ...]:
        return (1.0,)


@contextmanager
def known_to_the_filter() -> Iterator[str]:
    """EFFECTS with the free force in it; yields its name."""
    EFFECTS[FreeForce.name] = FreeForce
    try:
        yield FreeForce.name
    finally:
        EFFECTS.pop(FreeForce.name)
