# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The same kernel without a compiler: Runge-Kutta loops in NumPy around CasADi's virtual machine.

Arrays and results are those of `kernel.CompiledKernel`; columns of a matrix are batch elements.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fish_sim.methods import Method
from fish_sim.model import DT, Layout, functions
from fish_sim.robot import Structure

Array = NDArray[np.float64]


class InterpretedKernel:
    """step, JVP and VJP of the C texts on (size, batch) matrices."""

    def __init__(self, structure: Structure, method: Method, substeps: int) -> None:
        self._functions = functions(structure)
        self._nx = len(Layout(structure).motion)
        self._method, self._substeps = method, substeps
        self._A = np.array(method.A)

    def rollout(self, states: Array, commands: Array, parameters: Array) -> None:
        """Fill states[1:] from states[0]."""
        p = _columns(parameters, states.shape[1])
        for t in range(len(commands)):
            states[t + 1] = self._step(states[t].T, _columns(commands[t], states.shape[1]), p)[0].T

    def rollout_jvp(
        self,
        states: Array,
        tangents: Array,
        commands: Array,
        d_commands: Array,
        parameters: Array,
        d_parameters: Array,
    ) -> None:
        """Fill states[1:] and tangents[1:]."""
        batch = states.shape[1]
        p, dp = _columns(parameters, batch), _columns(d_parameters, batch)
        for t in range(len(commands)):
            c, dc = _columns(commands[t], batch), _columns(d_commands[t], batch)
            s, ds = self._step_jvp(states[t].T, tangents[t].T, c, dc, p, dp)
            states[t + 1], tangents[t + 1] = s.T, ds.T

    def rollout_vjp(
        self,
        states: Array,
        commands: Array,
        parameters: Array,
        g_states: Array,
        g_start: Array,
        g_commands: Array,
        g_parameters: Array,
    ) -> None:
        """Fill g_start, g_commands and g_parameters."""
        batch = states.shape[1]
        p, g = _columns(parameters, batch), g_states[-1].T.copy()
        gp = np.zeros_like(p)
        for t in reversed(range(len(commands))):
            g, gc = self._step_vjp(states[t].T, g, _columns(commands[t], batch), p, gp)
            g = g + g_states[t].T
            g_commands[t] = gc.T
        g_start[:], g_parameters[:] = g.T, gp.T

    def rates_jvp(
        self,
        x: Array,
        dx: Array,
        w: Array,
        dw: Array,
        parameters: Array,
        d_parameters: Array,
        out: Array,
        d_out: Array,
    ) -> None:
        """Fill out and d_out (batch, NX) with rates of motion and their tangents."""
        p, dp = _columns(parameters, len(x)), _columns(d_parameters, len(x))
        out[:], d_out[:] = (
            v.full().T for v in self._functions.rate_jvp(x.T, w.T, p, dx.T, dw.T, dp)
        )

    def memory_jvp(
        self,
        memory: Array,
        tangents: Array,
        commands: Array,
        parameters: Array,
        d_parameters: Array,
    ) -> None:
        """Fill memory[1:] and tangents[1:] (T + 1, batch, NM)."""
        batch = memory.shape[1]
        p, dp = _columns(parameters, batch), _columns(d_parameters, batch)
        for t in range(len(commands)):
            c = _columns(commands[t], batch)
            m, dm = self._functions.follow_jvp(memory[t].T, c, p, tangents[t].T, 0.0 * c, dp)
            memory[t + 1], tangents[t + 1] = m.full().T, dm.full().T

    def _step(self, s: Array, c: Array, p: Array) -> tuple[Array, list[Array]]:
        """(state after the step, the state at every stage of every substep)."""
        x, m0 = s[: self._nx], s[self._nx :]
        m1 = self._functions.follow(m0, c, p).full()
        h, stages = DT / self._substeps, []
        for sub in range(self._substeps):
            K: list[Array] = []
            for i, fraction in enumerate(self._fractions(sub)):
                stages.append(x + h * _combine(self._A[i], K, x))
                K.append(self._functions.rate(stages[-1], _drive(m0, m1, fraction), p).full())
            x = x + h * _combine(self._method.B, K, x)
        return np.vstack([x, m1]), stages

    def _step_jvp(
        self, s: Array, ds: Array, c: Array, dc: Array, p: Array, dp: Array
    ) -> tuple[Array, Array]:
        x, dx, m0, dm0 = s[: self._nx], ds[: self._nx], s[self._nx :], ds[self._nx :]
        m1, dm1 = (v.full() for v in self._functions.follow_jvp(m0, c, p, dm0, dc, dp))
        h = DT / self._substeps
        for sub in range(self._substeps):
            K: list[Array] = []
            dK: list[Array] = []
            for i, fraction in enumerate(self._fractions(sub)):
                X, dX = x + h * _combine(self._A[i], K, x), dx + h * _combine(self._A[i], dK, x)
                w, dw = _drive(m0, m1, fraction), _drive(dm0, dm1, fraction)
                k, dk = self._functions.rate_jvp(X, w, p, dX, dw, dp)
                K.append(k.full())
                dK.append(dk.full())
            x, dx = x + h * _combine(self._method.B, K, x), dx + h * _combine(self._method.B, dK, x)
        return np.vstack([x, m1]), np.vstack([dx, dm1])

    def _step_vjp(self, s: Array, g: Array, c: Array, p: Array, gp: Array) -> tuple[Array, Array]:
        """(adjoint of the state before, of the command); adds to gp."""
        m0, gx, gm1 = s[self._nx :], g[: self._nx], g[self._nx :].copy()
        gm0 = np.zeros_like(m0)
        after, stages = self._step(s, c, p)
        m1, h, B = after[self._nx :], DT / self._substeps, self._method.B
        for sub in reversed(range(self._substeps)):
            gX: dict[int, Array] = {}
            for i, fraction in reversed(list(enumerate(self._fractions(sub)))):
                gK = h * (B[i] * gx + sum((self._A[j][i] * gX[j] for j in gX), 0.0 * gx))
                stage = stages[sub * len(B) + i]
                adjoints = self._functions.rate_vjp(stage, _drive(m0, m1, fraction), p, gK)
                gX[i], gw, gp_part = (v.full() for v in adjoints)
                gm0[:2] += gw[[0, 2]] * (1.0 - fraction) - gw[[1, 3]] / DT
                gm1[:2] += gw[[0, 2]] * fraction + gw[[1, 3]] / DT
                gp += gp_part
            gx = gx + sum(gX.values())
        gm, gc, gp_part = (v.full() for v in self._functions.follow_vjp(m0, c, p, gm1))
        gp += gp_part
        return np.vstack([gx, gm0 + gm]), gc

    def _fractions(self, sub: int) -> list[float]:
        return [(sub + c) / self._substeps for c in self._method.C]


def _columns(rows: Array, batch: int) -> Array:
    return np.ascontiguousarray(np.broadcast_to(rows, (batch, rows.shape[-1])).T)


def _drive(m0: Array, m1: Array, fraction: float) -> Array:
    """alpha, alpha', rotor speed and acceleration at a fraction of the period."""
    value, rate = m0[:2] + (m1[:2] - m0[:2]) * fraction, (m1[:2] - m0[:2]) / DT
    return np.stack([value[0], rate[0], value[1], rate[1]])


def _combine(weights: tuple[float, ...] | Array, K: list[Array], like: Array) -> Array:
    return sum((a * k for a, k in zip(weights, K, strict=False) if a != 0.0), np.zeros_like(like))
