# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Which method integrates a period of 10 ms in how many steps."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from fish_sim.methods import METHODS
from fish_sim.model import DT
from fish_sim.robot import Robot
from fish_sim.stability import GROWTH, MAX_SUBSTEPS, enough_substeps, growth, modes_at_rest

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
