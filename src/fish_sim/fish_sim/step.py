# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Advance the fish: `Stepper` for NumPy arrays, compiled where a C compiler exists, interpreted otherwise.

One step is one command period of 10 ms. Shapes: state (..., NS), command (..., 2), parameters (NP,) or (..., NP).
Values, tangents (JVP) and adjoints (VJP) come from the same expressions.
"""

from __future__ import annotations

import functools

import numpy as np
from numpy.typing import NDArray

from fish_sim.checks import check_finite
from fish_sim.compiled import compiler, lanes, library
from fish_sim.interpreted import InterpretedKernel
from fish_sim.kernel import CompiledKernel, Part
from fish_sim.kernel_source import kernel_source
from fish_sim.methods import METHODS
from fish_sim.model import COMMAND_NAMES, DRIVE_NAMES, Layout, functions
from fish_sim.robot import Robot, Structure
from fish_sim.scheme import Scheme, check_scheme, default_scheme, stable_scheme
from fish_sim.self_check import kernel_errors

Array = NDArray[np.float64]


SETTLED = 300  # periods of 10 ms after which servo and motor have followed a constant command


class Stepper:
    """The motion of one structure of robot (links, effects) under one integration scheme."""

    def __init__(
        self, structure: Structure, scheme: Scheme | None = None, compiled: bool = True
    ) -> None:
        self.layout = Layout(structure)
        self.scheme = scheme or default_scheme(structure[0])
        self._compiled = compiled and compiler() is not None

    @classmethod
    def of(cls, robot: Robot, scheme: Scheme | None = None) -> Stepper:
        """The stepper of a robot, by default with steps that its own modes allow; see `parameters`.

        Raises:
            ValueError: the scheme's steps are too coarse for this robot.
        """
        if scheme is not None:
            check_scheme(scheme, robot)
        return cls(robot.structure, scheme or stable_scheme(robot))

    def parameters(self, robot: Robot) -> Array:
        """The robot's parameter vector (NP,)."""
        if robot.structure != self.layout.structure:
            raise ValueError(
                f"robot: got {Layout(robot.structure)}; this stepper is for {self.layout}"
            )
        return np.array(robot.vector())

    def rest(
        self,
        pose: tuple[float, float, float] = (0.0, 0.0, 0.0),
        rudder: float = 0.0,
        parameters: Array | None = None,
    ) -> Array:
        """State (NS,) at rest at a pose (x, y, heading) [m, m, rad] with a straight tail.

        With parameters (NP,) the servo stands where a centred command leaves it, which an offset horn is not at 0.
        """
        state = np.zeros(len(self.layout.state))
        state[:2] = pose[:2]
        state[2 : 3 + self.layout.links] = pose[2]
        state[len(self.layout.motion)] = rudder
        if parameters is not None:
            state[len(self.layout.motion) :] = self.settled_memory(np.zeros((1, 2)), parameters)[0][
                0
            ]
        return state

    def settled_memory(
        self, command: Array, parameters: Array, d_parameters: Array | None = None
    ) -> tuple[Array, Array]:
        """Memory (B, NM) long after a constant command (B, 2), and its derivative along d_parameters."""
        start = np.zeros((len(command), len(self.layout.memory)))
        commands = np.broadcast_to(command, (SETTLED, *np.shape(command)))
        d_parameters = np.zeros_like(parameters) if d_parameters is None else d_parameters
        memory, tangents = self.memory_jvp(start, commands, parameters, d_parameters)
        return memory[-1], tangents[-1]

    def step(self, state: Array, command: Array, parameters: Array) -> Array:
        """The state 10 ms later."""
        after: Array = self.rollout(state, np.asarray(command)[None], parameters)[1]
        return after

    def rollout(self, start: Array, commands: Array, parameters: Array) -> Array:
        """States (T + 1, ..., NS) from start (..., NS) under commands (T, ..., 2).

        Raises:
            ValueError: a wrong shape; a command, a parameter or the one start state is not finite. Of a batch of start
                states the bad ones stay bad (`checks.diverged`) and leave the others alone.
        """
        start, commands, parameters, shape = self._arrange(start, commands, parameters)
        check_finite("command", commands, COMMAND_NAMES)
        check_finite("parameter", parameters, self.layout.parameters)
        if not shape:
            check_finite("state", start[0], self.layout.state)
        states = np.empty((len(commands) + 1, *start.shape))
        states[0] = start
        self._kernel(len(start)).rollout(states, commands, parameters)
        return states.reshape(len(states), *shape, states.shape[-1])

    def rollout_jvp(
        self,
        start: Array,
        commands: Array,
        parameters: Array,
        d_start: Array,
        d_commands: Array,
        d_parameters: Array,
    ) -> tuple[Array, Array]:
        """States and their derivative along (d_start, d_commands, d_parameters), shapes as the values or broadcast."""
        lead = np.broadcast_shapes(
            np.shape(start)[:-1],
            np.shape(d_start)[:-1],
            np.shape(d_parameters)[:-1],
            np.shape(d_commands)[1:-1],
        )
        start = np.broadcast_to(start, (*lead, np.shape(start)[-1]))
        d_commands = np.broadcast_to(d_commands, (len(commands), *np.shape(d_commands)[1:]))
        start, commands, parameters, shape = self._arrange(start, commands, parameters)
        ds, dc, dp, _ = self._arrange(
            np.broadcast_to(d_start, (*shape, start.shape[-1])), d_commands, d_parameters
        )
        states, tangents = (np.empty((len(commands) + 1, *start.shape)) for _ in range(2))
        states[0], tangents[0] = start, ds
        self._kernel(len(start), "tangents").rollout_jvp(
            states, tangents, commands, dc, parameters, dp
        )
        return tuple(a.reshape(len(a), *shape, a.shape[-1]) for a in (states, tangents))  # type: ignore[return-value]

    def rollout_vjp(
        self, states: Array, commands: Array, parameters: Array, g_states: Array
    ) -> tuple[Array, Array, Array]:
        """Adjoints of (start, commands, parameters), per batch element, from adjoints of all states of a rollout."""
        start, commands, parameters, shape = self._arrange(states[0], commands, parameters)
        flat = [
            np.ascontiguousarray(a, float).reshape(len(states), *start.shape)
            for a in (states, g_states)
        ]
        batch = len(start)
        g_start, g_commands = (
            np.empty_like(start),
            np.empty((len(commands), batch, commands.shape[-1])),
        )
        g_parameters = np.empty((batch, parameters.shape[-1]))
        self._kernel(batch, "adjoints").rollout_vjp(
            flat[0], commands, parameters, flat[1], g_start, g_commands, g_parameters
        )
        return (
            g_start.reshape(*shape, g_start.shape[-1]),
            g_commands.reshape(len(commands), *shape, 2),
            g_parameters.reshape(*shape, g_parameters.shape[-1]),
        )

    def rates_jvp(
        self,
        motion: Array,
        drive: Array,
        parameters: Array,
        d_motion: Array,
        d_drive: Array,
        d_parameters: Array,
    ) -> tuple[Array, Array]:
        """Rates of motion at single instants and their derivative along a direction.

        motion (B, NX), drive (B, 4) as DRIVE_NAMES, parameters (NP,) or (B, NP); tangents likewise.
        """
        x, dx, w, dw = (
            np.ascontiguousarray(a, dtype=float) for a in (motion, d_motion, drive, d_drive)
        )
        p, dp = (
            np.ascontiguousarray(np.atleast_2d(a), dtype=float) for a in (parameters, d_parameters)
        )
        self._check_width("motion", x, len(self.layout.motion))
        self._check_width("drive", w, len(DRIVE_NAMES))
        self._check_width("parameters", p, len(self.layout.parameters))
        rate, tangent = np.empty_like(x), np.empty_like(x)
        self._kernel(len(rate), "tangents").rates_jvp(x, dx, w, dw, p, dp, rate, tangent)
        return rate, tangent

    def memory_jvp(
        self,
        start: Array,
        commands: Array,
        parameters: Array,
        d_parameters: Array,
        d_start: Array | float = 0.0,
    ) -> tuple[Array, Array]:
        """Memory (T + 1, B, NM) under commands (T, B, 2), which needs no motion, and its derivative along d_parameters.

        start and d_start (B, NM); parameters and d_parameters (NP,) or (B, NP).
        """
        start = np.ascontiguousarray(start, dtype=float)
        memory = np.empty((len(commands) + 1, *start.shape))
        tangents = np.empty_like(memory)
        memory[0], tangents[0] = start, d_start
        p, dp = (
            np.ascontiguousarray(np.atleast_2d(a), dtype=float) for a in (parameters, d_parameters)
        )
        self._check_width("memory", start, len(self.layout.memory))
        commands = np.ascontiguousarray(commands, dtype=float)
        self._kernel(start.shape[0], "memory").memory_jvp(memory, tangents, commands, p, dp)
        return memory, tangents

    def outputs(self, state: Array, drive_end: Array, parameters: Array) -> dict[str, Array]:
        """Accelerations q'', tip force [N] and slip [m/s] of states (..., NS) at rest inputs.

        drive_end: (..., 2) rates of alpha [rad/s] and rotor speed [rad/s^2] acting at that instant.
        """
        state = np.asarray(state, float)
        lead = state.shape[:-1]
        flat = state.reshape(-1, state.shape[-1])
        rates = np.broadcast_to(drive_end, (*lead, 2)).reshape(-1, 2)
        motion = flat[:, : len(self.layout.motion)]
        alpha, speed = flat[:, motion.shape[1]], flat[:, motion.shape[1] + 1]
        w = np.stack([alpha, rates[:, 0], speed, rates[:, 1]])
        p = np.broadcast_to(parameters, (*lead, np.shape(parameters)[-1])).reshape(len(flat), -1)
        values = functions(self.layout.structure).outputs(motion.T, w, p.T)
        acceleration, force, slip = (v.full().T for v in values)
        return {
            "acceleration": acceleration.reshape(*lead, -1),
            "tip_force": force.reshape(lead),
            "slip": slip.reshape(lead),
        }

    def _arrange(
        self, start: Array, commands: Array, parameters: Array
    ) -> tuple[Array, Array, Array, tuple[int, ...]]:
        """Flatten batch axes: (B, NS), (T, B or 1, 2), (B or 1, NP), and the batch shape."""
        start, commands, parameters = (
            np.asarray(a, dtype=float) for a in (start, commands, parameters)
        )
        self._check_width("state", start, len(self.layout.state))
        self._check_width("commands", commands, len(COMMAND_NAMES))
        self._check_width("parameters", parameters, len(self.layout.parameters))
        shape = np.broadcast_shapes(start.shape[:-1], commands.shape[1:-1], parameters.shape[:-1])
        batch = int(np.prod(shape, dtype=int))
        flat_start = np.broadcast_to(start, (*shape, start.shape[-1])).reshape(
            batch, start.shape[-1]
        )
        if commands.ndim == 2:
            flat_commands = commands[:, None]
        else:
            flat_commands = np.broadcast_to(commands, (len(commands), *shape, 2)).reshape(
                len(commands), batch, 2
            )
        if parameters.ndim == 1:
            flat_parameters = parameters[None]
        else:
            width = parameters.shape[-1]
            flat_parameters = np.broadcast_to(parameters, (*shape, width)).reshape(batch, width)
        arrays = (np.ascontiguousarray(a) for a in (flat_start, flat_commands, flat_parameters))
        return (*arrays, shape)  # type: ignore[return-value]

    def _check_width(self, name: str, array: Array, width: int) -> None:
        if array.ndim == 0 or array.shape[-1] != width:
            raise ValueError(
                f"{name}: got shape {array.shape}; expected (..., {width}) for {self.layout}"
            )

    def _kernel(self, batch: int, part: Part = "values") -> CompiledKernel | InterpretedKernel:
        width = 1 if batch == 1 else lanes()
        return kernel(self.layout.structure, self.scheme, width, self._compiled, part)


@functools.lru_cache(maxsize=256)
def kernel(
    structure: Structure, scheme: Scheme, width: int, compiled: bool, part: Part
) -> CompiledKernel | InterpretedKernel:
    """One part of a structure's kernel: compiled for `width` lanes and checked, or interpreted."""
    loaded = None
    if compiled:
        check = functools.partial(kernel_errors, structure, scheme, width, part)
        source = kernel_source(structure, scheme, width, part)
        loaded = library(source, check, width, derivatives=part != "values")
    if loaded is None:
        return InterpretedKernel(structure, METHODS[scheme.method], scheme.substeps)
    return CompiledKernel(loaded)
