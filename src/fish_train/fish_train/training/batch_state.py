# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The state of a batch of fish between two windows of the closed loop."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fish_control.line_of_sight import GuidanceState
from fish_train.training.closed_loop_equations import PHYSICS_STEPS, SIZES

Array = NDArray[np.float64]
HISTORY = 32  # physics steps of 10 ms kept for delayed vision
LONGEST_DELAY = HISTORY - PHYSICS_STEPS + 1
# memory of the guidance before the first period; all else starts at zero
START = GuidanceState().flat
MEMORY_SIZE = SIZES["guidance"] + SIZES["control"] + SIZES["actuator"] + SIZES["last"]


@dataclass
class BatchState:
    """B fish between two windows; arrays are C-contiguous and are written in place.

    Attributes:
        plant: (B, NS) simulator states. memory: (B, MEMORY_SIZE) guidance, control, actuators, last gains and
            set-point.
        place: (B, 4) progress [m] and captured flag, of the path as seen and of the true one.
        history: (B, HISTORY, 6) past motions, newest last.
        parameters: (B, NP) of the robots. path: (B,) numbers in the bank. speed: (B,) wanted surge [m/s].
        delay: (B,) physics steps (10 ms) by which what is seen is old; at most LONGEST_DELAY.
    """

    plant: Array
    memory: Array
    place: Array
    history: Array
    parameters: Array
    path: NDArray[np.int64]
    speed: Array
    delay: NDArray[np.int64]

    @classmethod
    def at(
        cls,
        plant: Array,
        parameters: Array,
        path: NDArray[np.int64],
        speed: Array,
        motion: Array,
        delay: NDArray[np.int64] | None = None,
    ) -> BatchState:
        """Fish that start an episode: controllers reset, what they see now was true all the time (`motion` (B, 6))."""
        batch = len(plant)
        return cls(
            plant=np.array(plant, dtype=float, order="C"),
            memory=np.repeat([[*START, *np.zeros(MEMORY_SIZE - len(START))]], batch, axis=0),
            place=np.zeros((batch, 4)),
            history=np.repeat(np.asarray(motion, dtype=float)[:, None], HISTORY, axis=1).copy(),
            parameters=np.ascontiguousarray(
                np.broadcast_to(parameters, (batch, np.shape(parameters)[-1])), float
            ),
            path=np.asarray(path, dtype=np.int64),
            speed=np.asarray(speed, dtype=float),
            delay=np.zeros(batch, dtype=np.int64)
            if delay is None
            else np.asarray(delay, dtype=np.int64),
        )

    def __len__(self) -> int:
        return len(self.plant)

    def copy(self) -> BatchState:
        """An independent copy."""
        return BatchState(**{name: value.copy() for name, value in vars(self).items()})


def check_hold(steps: int, hold: int) -> None:
    """A window is a whole number of policy decisions."""
    if hold < 1 or steps < 1 or steps % hold:
        raise ValueError(f"hold: got {hold} for a window of {steps} periods; expected a divisor")


@dataclass(frozen=True)
class WindowResult:
    """What a window of T periods cost and showed.

    Attributes:
        cost: mean stage cost over periods and fish. gradient: (W,) its derivative in the flat weights, or None.
        report: (T + 1, B, 3) true cross-track [m], heading [rad] and speed error [m/s] at the start of each period and
            at the end. applied: (T, B, 8) gains and set-point of each period.
    """

    cost: float
    gradient: Array | None
    report: Array
    applied: Array
