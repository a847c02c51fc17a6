"""What to ask before and after a rollout: usable numbers, a step that is fine enough, what diverged.

The stepper refuses commands, parameters and a single start state that are not finite. In a batch an element that
starts or becomes non-finite stays so and leaves the others alone; `diverged` tells which.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fish_sim.finite import check_finite
from fish_sim.methods import METHODS
from fish_sim.model import COMMAND_NAMES, DT
from fish_sim.scheme import DEFAULT_METHOD
from fish_sim.stability import GROWTH, enough_substeps, growth, modes_at_rest
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


def check_scheme(stepper: Stepper, parameters: Array) -> None:
    """Raise ValueError if the stepper's scheme blows up the fish's own modes about rest.

    With the eigenvalues s of the linearised motion the growth per step of h is |R(h s)|, R the method's
    stability function; modes that grow by themselves are not the scheme's fault.
    """
    scheme, method = stepper.scheme, METHODS[stepper.scheme.method]
    modes = modes_at_rest(stepper.layout.structure, parameters)
    if growth(method, modes, scheme.substeps) <= 1.0 + GROWTH:
        return
    enough = enough_substeps(method, modes)
    advice = f"use substeps >= {enough}" if enough else f"use another method ({DEFAULT_METHOD})"
    raise ValueError(
        f"substeps = {scheme.substeps} ({scheme.method}, {1e3 * DT / scheme.substeps:g} ms): unstable for"
        f" this robot, whose fastest mode is at {np.abs(modes).max():.0f} 1/s; {advice}"
    )
