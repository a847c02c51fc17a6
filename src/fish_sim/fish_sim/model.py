# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The equations as CasADi functions for one structure: number of links and enabled effects.

Layout of the state vector of a step:
    q (n+3), q' (n+3), continuous states of the effects, alpha, rotor_speed, discrete memory of the effects
Command: rotor_speed [rad/s], rudder [rad]. A command is followed over one period of DT: rotor speed and alpha move
linearly towards it within the period, alpha at most at the servo's rate limit.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from types import SimpleNamespace
from typing import Any

import casadi

from fish_sim.chain import EnabledEffect
from fish_sim.dynamics import Solution, solve
from fish_sim.effects.effect import Drive, Effect
from fish_sim.ops import CASADI, Scalar
from fish_sim.robot import Structure, nominal_parameters, parameter_names

DT = 0.01  # s, period of the commands
COMMAND_NAMES = ("rotor_speed", "rudder")  # rad/s, rad
DRIVE_NAMES = ("alpha", "alpha_dot", "rotor_speed", "rotor_acceleration")


@dataclass(frozen=True)
class Layout:
    """Names and places of everything in the vectors of a structure."""

    structure: Structure

    def __str__(self) -> str:
        names = ", ".join(effect.name for effect in self.effects) or "no effects"
        return f"structure ({self.links} links; {names})"

    @property
    def links(self) -> int:
        return self.structure[0]

    @property
    def effects(self) -> tuple[type[Effect], ...]:
        return self.structure[1]

    @cached_property
    def coordinates(self) -> tuple[str, ...]:
        return ("x", "y", "theta_head", *(f"theta_{i}" for i in range(1, self.links + 1)))

    @cached_property
    def motion(self) -> tuple[str, ...]:
        """What the integrator moves: q, q' and the continuous states of the effects."""
        rates = tuple(f"{name}_dot" for name in self.coordinates)
        return (*self.coordinates, *rates, *self._own("states"))

    @cached_property
    def memory(self) -> tuple[str, ...]:
        """What a command updates once: rudder and motor, the servo where it differs, then the memory of the effects."""
        servo = ("servo",) if self.has_linkage else ()
        return ("alpha", "rotor_speed", *servo, *self._own("memory"))

    @cached_property
    def has_linkage(self) -> bool:
        """Something between servo and rudder makes the two angles differ."""
        return any(effect.has_linkage for effect in self.effects)

    @cached_property
    def state(self) -> tuple[str, ...]:
        return (*self.motion, *self.memory)

    @cached_property
    def parameters(self) -> tuple[str, ...]:
        return parameter_names(self.structure)

    def _own(self, kind: str) -> tuple[str, ...]:
        return tuple(f"{e.name}.{key}" for e in self.effects for key in getattr(e, kind))


def unpack_effects(
    layout: Layout, p: Sequence[Scalar], states: Sequence[Scalar], kind: str
) -> tuple[SimpleNamespace, list[EnabledEffect]]:
    """(nominal parameters by name, enabled effects with parameters and their own `kind` of states)."""
    nominal = list(nominal_parameters(layout.links))
    r = SimpleNamespace(**dict(zip(nominal, p, strict=False)))
    at_p, at_z, enabled = len(nominal), 0, []
    for effect in layout.effects:
        keys, own = list(effect.parameters), list(getattr(effect, kind))
        values = SimpleNamespace(**dict(zip(keys, p[at_p : at_p + len(keys)], strict=True)))
        z = SimpleNamespace(**dict(zip(own, states[at_z : at_z + len(own)], strict=True)))
        enabled.append(EnabledEffect(effect, values, z))
        at_p, at_z = at_p + len(keys), at_z + len(own)
    return r, enabled


def motion_solution(
    layout: Layout,
    x: Sequence[Scalar],
    drive: Sequence[Scalar],
    p: Sequence[Scalar],
    xp: Any,
    constrained: bool = True,
) -> Solution:
    """Solve the equations for a motion vector (`layout.motion`), DRIVE_NAMES and parameters."""
    size = layout.links + 3
    r, effects = unpack_effects(layout, p, x[2 * size :], "states")
    return solve(x[:size], x[size : 2 * size], Drive(*drive), r, effects, xp, constrained)


def motion_rate(
    layout: Layout, x: Sequence[Scalar], drive: Sequence[Scalar], p: Sequence[Scalar], xp: Any
) -> list[Scalar]:
    """Time derivative of the motion vector."""
    return solution_rate(layout, x, motion_solution(layout, x, drive, p, xp))


def solution_rate(layout: Layout, x: Sequence[Scalar], solution: Solution) -> list[Scalar]:
    """Time derivative of the motion vector, of the solved equations."""
    size = layout.links + 3
    return [*x[size : 2 * size], *solution.acceleration, *solution.state_rates]


def follow_command(
    layout: Layout,
    m: Sequence[Scalar],
    command: Sequence[Scalar],
    p: Sequence[Scalar],
    dt: float,
    xp: Any,
) -> list[Scalar]:
    """Memory at the end of a command's period: what servo, motor and the actuator effects make of it."""
    own = 3 if layout.has_linkage else 2
    r, effects = unpack_effects(layout, p, m[own:], "memory")
    rotor, rudder = command
    # the range is the command's; with a rudder offset the rudder itself goes beyond it
    rudder = xp.fmax(xp.fmin(rudder, r.rudder_range), -r.rudder_range)
    kept: list[dict[str, Scalar]] = []
    for e in effects:
        rudder, followed = e.effect.rudder(e.p, e.z, rudder, dt, xp)
        rotor, turned = e.effect.rotor(e.p, e.z, rotor, dt, xp)
        kept.append({**followed, **turned})
    before = m[2] if layout.has_linkage else m[0]
    for e in effects:
        rudder = e.effect.servo(e.p, before, rudder, dt, xp)
    limit = r.servo_rate_limit * dt
    alpha = servo = before + xp.fmax(xp.fmin(rudder - before, limit), -limit)
    for e, values in zip(effects, kept, strict=True):
        alpha, linked = e.effect.linkage(e.p, e.z, alpha, dt, xp)
        values.update(linked)
    memory = [
        values[key] for e, values in zip(effects, kept, strict=True) for key in e.effect.memory
    ]
    return [alpha, rotor, *([servo] if layout.has_linkage else []), *memory]


class Functions:
    """CasADi functions of a structure; arguments are columns, a matrix argument maps over its columns.

    rate(x, w, p) -> x'; rate_jvp(x, w, p, dx, dw, dp) -> (x', dx'); rate_vjp(x, w, p, g) -> (gx, gw, gp);
    rate_and_vjp(x, w, p, g) -> (x', gx, gw, gp);
    follow, follow_jvp, follow_vjp likewise of (m, c, p) -> m'; outputs(x, w, p) -> (q'', tip_force, slip).
    Each is built when it is first asked for: a search takes dozens of structures and needs little of each.
    """

    def __init__(self, structure: Structure, dt: float) -> None:
        layout = Layout(structure)
        x = casadi.SX.sym("x", len(layout.motion))
        w = casadi.SX.sym("w", len(DRIVE_NAMES))
        p = casadi.SX.sym("p", len(layout.parameters))
        m = casadi.SX.sym("m", len(layout.memory))
        c = casadi.SX.sym("c", len(COMMAND_NAMES))
        xs, ws, ps, ms, cs = (casadi.vertsplit(v) for v in (x, w, p, m, c))
        self._solution = motion_solution(layout, xs, ws, ps, CASADI)
        self._motion = Expression(
            "rate", [x, w, p], casadi.vertcat(*solution_rate(layout, xs, self._solution))
        )
        followed = follow_command(layout, ms, cs, ps, dt, CASADI)
        self._memory = Expression("follow", [m, c, p], casadi.vertcat(*followed))

    rate = cached_property(lambda self: self._motion.function())
    rate_jvp = cached_property(lambda self: self._motion.jvp())
    rate_vjp = cached_property(lambda self: self._motion.vjp())
    rate_and_vjp = cached_property(lambda self: self._motion.value_and_vjp())
    follow = cached_property(lambda self: self._memory.function())
    follow_jvp = cached_property(lambda self: self._memory.jvp())
    follow_vjp = cached_property(lambda self: self._memory.vjp())

    @cached_property
    def outputs(self) -> casadi.Function:
        """Accelerations, the force that holds the tip and its slip."""
        found = self._solution
        values = [casadi.vertcat(*found.acceleration), found.tip_force, found.slip]
        return casadi.Function("outputs", self._motion.inputs, casadi.cse(values))


@lru_cache(maxsize=64)
def functions(structure: Structure, dt: float = DT) -> Functions:
    """The symbolic functions of a structure, built once."""
    return Functions(structure, dt)


@dataclass(frozen=True)
class Expression:
    """A column of expressions of some columns of symbols, and its derivatives."""

    name: str
    inputs: list[casadi.SX]
    value: Any  # casadi.SX, one column

    def function(self) -> casadi.Function:
        """inputs -> value."""
        return casadi.Function(self.name, self.inputs, casadi.cse([self.value]))

    def jvp(self) -> casadi.Function:
        """(inputs, their tangents) -> (value, its tangent)."""
        tangents = [casadi.SX.sym(f"d{i}", *v.shape) for i, v in enumerate(self.inputs)]
        forward = casadi.jtimes(self.value, casadi.vertcat(*self.inputs), casadi.vertcat(*tangents))
        return casadi.Function(
            f"{self.name}_jvp", [*self.inputs, *tangents], casadi.cse([self.value, forward])
        )

    def vjp(self) -> casadi.Function:
        """(inputs, adjoint of the value) -> adjoints of the inputs."""
        adjoint, reverse = self._reverse()
        return casadi.Function(f"{self.name}_vjp", [*self.inputs, adjoint], casadi.cse(reverse))

    def value_and_vjp(self) -> casadi.Function:
        """(inputs, adjoint of the value) -> (value, adjoints of the inputs)."""
        adjoint, reverse = self._reverse()
        inputs, values = [*self.inputs, adjoint], [self.value, *reverse]
        return casadi.Function(f"{self.name}_and_vjp", inputs, casadi.cse(values))

    def _reverse(self) -> tuple[casadi.SX, list[casadi.SX]]:
        adjoint = casadi.SX.sym("g", *self.value.shape)
        reverse = casadi.jtimes(self.value, casadi.vertcat(*self.inputs), adjoint, True)
        cuts = [0]
        for v in self.inputs:
            cuts.append(cuts[-1] + v.shape[0])
        return adjoint, casadi.vertsplit(reverse, cuts)
