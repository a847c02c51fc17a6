# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""A compiled kernel against the interpreted one: what the compiler made of the C text is not taken on trust.

Both run a few periods of a few fish of the same random states, commands, parameters and directions: one fish alone, and
one more than a vector holds. The draws are seeded and typical of a swimming fish.
"""

from __future__ import annotations

import ctypes
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fish_sim.interpreted import InterpretedKernel
from fish_sim.kernel import CompiledKernel, Part
from fish_sim.methods import METHODS
from fish_sim.model import DRIVE_NAMES, DT, Layout
from fish_sim.parameter import Parameter
from fish_sim.robot import Structure, nominal_parameters
from fish_sim.scheme import Scheme, modes_at_rest

Array = NDArray[np.float64]

PERIODS, MANY = 2, 16  # one period where it is that many steps of the integrator
SEED = 1
SPREAD = 0.1  # of the parameters about their typical values
FAINT = 0.02  # what a parameter without a typical value is, where its default is 0
UNBOUNDED, FAINTEST = (
    1e3,
    1e-6,
)  # and what it is where its range is no bound: a coefficient of products of anything
MASSES = ("_mass", "_mass_surge", "_mass_sway", "head_inertia")  # ends of their names
TURN = 1.0  # rad, by which the fastest mode of a sample turns in a step of the integrator at most
SMALL = 1e-3  # a component smaller than this share of the largest is measured by that share
# half widths by the name in a state vector; other angles and states of effects: ELSE
TYPICAL = {
    "x": 0.5,
    "y": 0.5,
    "theta_head": 3.0,
    "x_dot": 0.2,
    "y_dot": 0.2,
    "theta_head_dot": 1.0,
    "rotor_speed": 100.0,
}
ELSE, TAIL_RATE = 0.3, 3.0  # rad or of the effect's unit, rad/s


def kernel_errors(
    structure: Structure, scheme: Scheme, width: int, part: Part, library: ctypes.CDLL
) -> dict[str, float]:
    """Largest relative error of every result of one part of a compiled kernel, over both batches."""
    layout, errors = Layout(structure), dict[str, float]()
    interpreted = InterpretedKernel(structure, METHODS[scheme.method], scheme.substeps)
    for batch in (1, width + 1):
        sample = Sample.draw(layout, batch, 1 if scheme.substeps > MANY else PERIODS).slowed(scheme)
        right, found = (
            run(kernel, sample, part) for kernel in (interpreted, CompiledKernel(library))
        )
        for name, values in right.items():
            errors[name] = max(errors.get(name, 0.0), relative_error(found[name], values))
    return errors


def relative_error(found: Array, right: Array) -> float:
    """Largest difference (..., size), each component measured by its largest magnitude or SMALL of all components'.

    Infinite where a number of either is not finite.
    """
    if not (np.isfinite(found).all() and np.isfinite(right).all()):
        return np.inf
    found, right = (a.reshape(-1, a.shape[-1]) for a in (found, right))
    size = np.abs(right).max(axis=0)
    difference = np.abs(found - right).max(axis=0)
    scale = np.maximum(size, max(SMALL * float(size.max()), np.finfo(float).tiny))
    return float((difference / scale).max())


@dataclass(frozen=True)
class Sample:
    """Fish at T + 1 instants (their states do not follow from each other) with directions of everything."""

    layout: Layout
    states: Array  # (T + 1, B, NS)
    commands: Array  # (T, B, 2)
    drive: Array  # (B, 4)
    parameters: Array  # (B, NP)
    d_states: Array
    d_commands: Array
    d_drive: Array
    d_parameters: Array

    @classmethod
    def draw(cls, layout: Layout, batch: int, periods: int = PERIODS) -> Sample:
        """Random fish of a structure, always the same."""
        random = np.random.default_rng(SEED)
        states = random_states(layout, (periods + 1, batch), random)
        alpha = states[:-1, :, len(layout.motion)]
        # the servo follows some of the commands within a period, and is too slow for others
        commands = np.stack(
            [
                random.uniform(-100.0, 100.0, alpha.shape),
                alpha + random.uniform(-0.1, 0.1, alpha.shape),
            ],
            axis=-1,
        )
        drive = random.uniform(-1.0, 1.0, (batch, len(DRIVE_NAMES))) * [0.3, 5.0, 100.0, 1000.0]
        parameters = random_parameters(layout, batch, random)
        directions = (
            random.normal(size=a.shape) * np.abs(a).max(axis=tuple(range(a.ndim - 1)))
            for a in (states, commands, drive, parameters)
        )
        return cls(layout, states, commands, drive, parameters, *directions)

    def slowed(self, scheme: Scheme) -> Sample:
        """The same fish, as heavy as the scheme's steps need (`heaviness`)."""
        factor = heaviness(self.layout, scheme, self.parameters)
        return replace(
            self, parameters=self.parameters * factor, d_parameters=self.d_parameters * factor
        )


def random_states(layout: Layout, shape: tuple[int, ...], random: np.random.Generator) -> Array:
    """States (*shape, NS): in the middle of the pool, the tail bent, as fast as a fish swims."""
    tail = {f"theta_{k}_dot": TAIL_RATE for k in range(1, layout.links + 1)}
    widths = np.array([(TYPICAL | tail).get(name.split(".")[-1], ELSE) for name in layout.state])
    states: Array = random.uniform(-1.0, 1.0, (*shape, len(widths))) * widths
    states[..., 3 : layout.links + 3] += states[..., 2:3]  # angles are the pool's
    return states


def random_parameters(layout: Layout, batch: int, random: np.random.Generator) -> Array:
    """Parameters (B, NP) within SPREAD of typical ones, inside their ranges."""
    table = list(nominal_parameters(layout.links).values())
    table += [p for effect in layout.effects for p in effect.parameters.values()]
    factor = 1.0 + SPREAD * random.uniform(-1.0, 1.0, (batch, len(table)))
    ranges = np.array([(p.lowest, p.highest) for p in table]).T
    parameters: Array = np.clip(np.array([_typical(p) for p in table]) * factor, *ranges)
    return parameters


def heaviness(layout: Layout, scheme: Scheme, parameters: Array) -> Array:
    """Factors (NP,) of parameters (B, NP): 1 but for masses and inertias.

    A scheme may be too coarse for a typical fish: it is meant for a slower one. The motion would grow from step to step,
    and with it the rounding error of a right kernel. Masses grow until no mode turns by more than TURN in a step.
    """
    modes = modes_at_rest(layout.structure, parameters.mean(axis=0))
    turn = float(np.abs(modes).max()) * DT / scheme.substeps
    heavier = max(1.0, (turn / TURN) ** 2)  # a mode's rate goes with the mass's root, or faster
    return np.array(
        [
            heavier if name.endswith(MASSES) and "." not in name else 1.0
            for name in layout.parameters
        ]
    )


def run(kernel: CompiledKernel | InterpretedKernel, sample: Sample, part: Part) -> dict[str, Array]:
    """Every result of one part of a kernel for a sample."""
    s, c, p = sample.states.copy(), sample.commands, sample.parameters
    ds, dc, dp = sample.d_states.copy(), sample.d_commands, sample.d_parameters
    moving = len(sample.layout.motion)
    if part == "values":
        kernel.rollout(s, c, p)
        return {"states": s[1:]}
    if part == "tangents":
        x, dx = (np.ascontiguousarray(a[0, :, :moving]) for a in (s, ds))
        rates, d_rates = np.empty_like(x), np.empty_like(x)
        kernel.rates_jvp(x, dx, sample.drive, sample.d_drive, p, dp, rates, d_rates)
        kernel.rollout_jvp(s, ds, c, dc, p, dp)
        return {
            "states": s[1:],
            "tangents": ds[1:],
            "rates": rates,
            "tangents of the rates": d_rates,
        }
    if part == "memory":
        m, dm = (np.ascontiguousarray(a[..., moving:]) for a in (s, ds))
        kernel.memory_jvp(m, dm, c, p, dp)
        return {"memory": m[1:], "tangents of the memory": dm[1:]}
    # adjoints of states are as large as the states are small
    g_states = sample.d_states / np.square(np.abs(s).max(axis=(0, 1)))
    g_start, g_commands, g_parameters = np.empty_like(s[0]), np.empty_like(c), np.empty_like(p)
    kernel.rollout_vjp(s, c, p, g_states, g_start, g_commands, g_parameters)
    return {
        "adjoints of the start": g_start,
        "of the commands": g_commands,
        "of the parameters": g_parameters,
    }


def _typical(parameter: Parameter) -> float:
    value = parameter.value if parameter.typical is None else parameter.typical
    return value or (FAINTEST if parameter.highest > UNBOUNDED else FAINT)
