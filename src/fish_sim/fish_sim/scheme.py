# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Which method integrates a period of 10 ms in how many steps, and whether they are fine enough.

A step is fine enough where the method's stability function lets none of the fish's own modes about rest grow.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fish_sim.methods import METHODS, Method
from fish_sim.model import DT, Layout, functions
from fish_sim.robot import Robot, Structure

Modes = NDArray[np.complex128]

MAX_SUBSTEPS = 256
GROWTH = 1e-6  # of an undamped mode per step that still counts as stable


def modes_at_rest(structure: Structure, parameters: NDArray[np.float64]) -> Modes:
    """Eigenvalues [1/s] of the motion linearised about rest with a straight tail; parameters (NP,)."""
    size = len(Layout(structure).motion)
    rest, still = np.zeros((size, size)), np.zeros((4, size))
    p = np.tile(np.reshape(parameters, (-1, 1)), size)
    _, jacobian = functions(structure).rate_jvp(
        rest, still, p, np.eye(size), still, np.zeros_like(p)
    )
    return np.linalg.eigvals(jacobian.full()).astype(complex)


def growth(method: Method, modes: Modes, substeps: int) -> float:
    """Largest factor |R(h s)| by which a step of h = DT / substeps multiplies a mode s that does not grow by itself."""
    decaying = modes[modes.real <= GROWTH]
    return max(abs(_stability_function(method, s * DT / substeps)) for s in decaying)


def enough_substeps(method: Method, modes: Modes) -> int | None:
    """Smallest stable number of steps in a command period, or None."""
    numbers = range(1, MAX_SUBSTEPS + 1)
    return next((k for k in numbers if growth(method, modes, k) <= 1.0 + GROWTH), None)


def _stability_function(method: Method, z: complex) -> complex:
    """R(z): what one step of an explicit method makes of y' = z y, y = 1; k_i = z (1 + sum_j a_ij k_j), R = 1 + sum_i b_i k_i."""
    slopes: list[complex] = []
    for row in method.A:
        slopes.append(z * (1.0 + sum(a * k for a, k in zip(row, slopes, strict=False))))
    return 1.0 + sum(b * k for b, k in zip(method.B, slopes, strict=True))


DEFAULT_METHOD = "cfmr7"
# for 1, 2 .. 12 links: the fastest mode turns by at most 0.86 rad a step; n = 3 keeps its energy to 2e-7 per second
DEFAULT_SUBSTEPS = (1, 1, 2, 4, 7, 11, 16, 21, 27, 34, 41, 49)


@dataclass(frozen=True)
class Scheme:
    """How a period of 10 ms is integrated: a method of `methods.METHODS` and its number of steps in the period."""

    method: str = DEFAULT_METHOD
    substeps: int = 1

    def __post_init__(self) -> None:
        if self.method not in METHODS:
            raise ValueError(f"method: got {self.method!r}; expected one of {', '.join(METHODS)}")
        if (
            isinstance(self.substeps, bool)
            or not isinstance(self.substeps, int)
            or not 1 <= self.substeps <= MAX_SUBSTEPS
        ):
            raise ValueError(
                f"substeps: got {self.substeps!r}; expected a whole number from 1 to {MAX_SUBSTEPS}"
            )


def default_scheme(links: int) -> Scheme:
    """Steps fine enough for the nominal tail's fastest mode, which grows with the number of links."""
    return Scheme(DEFAULT_METHOD, DEFAULT_SUBSTEPS[links - 1])


def stable_scheme(robot: Robot, scheme: Scheme | None = None) -> Scheme:
    """A scheme (by default that of the robot's links), with more substeps if the robot's own modes need them."""
    scheme = scheme or default_scheme(robot.links)
    modes = modes_at_rest(robot.structure, np.array(robot.vector()))
    enough = enough_substeps(METHODS[scheme.method], modes)
    if enough is None:
        raise ValueError(
            f"robot: its fastest mode, {np.abs(modes).max():.0f} 1/s, is too fast for {MAX_SUBSTEPS} substeps of"
            f" {scheme.method} in {DT} s"
        )
    return replace(scheme, substeps=max(scheme.substeps, enough))


def check_scheme(scheme: Scheme, robot: Robot) -> None:
    """Raise ValueError if a scheme blows up the robot's own modes about rest.

    With the eigenvalues s of the linearised motion the growth per step of h is |R(h s)|, R the method's
    stability function; modes that grow by themselves are not the scheme's fault.
    """
    method = METHODS[scheme.method]
    modes = modes_at_rest(robot.structure, np.array(robot.vector()))
    if growth(method, modes, scheme.substeps) <= 1.0 + GROWTH:
        return
    enough = enough_substeps(method, modes)
    advice = f"use substeps >= {enough}" if enough else f"use another method ({DEFAULT_METHOD})"
    raise ValueError(
        f"substeps = {scheme.substeps} ({scheme.method}, {1e3 * DT / scheme.substeps:g} ms): unstable for"
        f" this robot, whose fastest mode is at {np.abs(modes).max():.0f} 1/s; {advice}"
    )
