"""What to ask before and after a rollout: usable numbers, what diverged.

The stepper refuses commands, parameters and a single start state that are not finite. In a batch an element that
starts or becomes non-finite stays so and leaves the others alone; `diverged` tells which.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fish_sim.finite import check_finite
from fish_sim.model import COMMAND_NAMES
from fish_sim.step import Stepper

Array = NDArray[np.float64]

FINITE_LIMIT = 1e6  # SI units; no state of a swimming fish comes near


def check_inputs(stepper: Stepper, state: Array, command: Array, parameters: Array) -> None:
    """Raise ValueError with name, batch index and value of the first number that is not finite."""
    layout = stepper.layout
    for what, array, names in (
        ("state", state, layout.state),
        ("command", command, COMMAND_NAMES),
        ("parameter", parameters, layout.parameters),
    ):
        check_finite(what, np.asarray(array, float), names)


def diverged(states: Array) -> NDArray[np.bool_]:
    """Which batch elements of states (T + 1, ..., NS) left the finite world: (...)."""
    finite: NDArray[np.bool_] = np.all(np.abs(states) < FINITE_LIMIT, axis=(0, -1))
    return ~finite
