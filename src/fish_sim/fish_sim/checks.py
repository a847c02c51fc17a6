"""What to ask before and after a rollout: usable numbers, a step that is fine enough, what diverged.

The kernels themselves do not look: a batch element that starts or becomes non-finite stays so and leaves the
others alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fish_sim.methods import METHODS, Method
from fish_sim.model import COMMAND_NAMES, DT
from fish_sim.robot import Robot
from fish_sim.step import Scheme, Stepper, default_scheme

Array = NDArray[np.float64]
Modes = NDArray[np.complex128]

MAX_SUBSTEPS = 100
GROWTH = 1e-6  # of an undamped mode per step that still counts as stable
FINITE_LIMIT = 1e6  # SI units; no state of a swimming fish comes near


def check_inputs(stepper: Stepper, state: Array, command: Array, parameters: Array) -> None:
    """Raise ValueError with name, batch index and value of the first number that is not finite."""
    layout = stepper.layout
    for what, array, names in (
        ("state", state, layout.state),
        ("command", command, COMMAND_NAMES),
        ("parameter", parameters, layout.parameters),
    ):
        _check_finite(what, np.asarray(array, float), names)


def _check_finite(what: str, array: Array, names: Sequence[str]) -> None:
    bad = np.argwhere(~np.isfinite(array))
    if len(bad):
        *where, k = bad[0]
        place = f" of batch element {tuple(map(int, where))}" if where else ""
        raise ValueError(
            f"{what} {names[k]}{place}: got {array[tuple(bad[0])]}; expected a finite number"
            f" ({len(bad)} such numbers in all)"
        )


def diverged(states: Array) -> NDArray[np.bool_]:
    """Which batch elements of states (T + 1, ..., NS) left the finite world: (...)."""
    finite: NDArray[np.bool_] = np.all(np.abs(states) < FINITE_LIMIT, axis=(0, -1))
    return ~finite


def check_scheme(stepper: Stepper, parameters: Array) -> None:
    """Raise ValueError if the stepper's scheme blows up the fish's own modes about rest.

    With the eigenvalues s of the linearised motion the growth per step of h is |R(h s)|, R the method's
    stability function; modes that grow by themselves are not the scheme's fault.
    """
    modes, scheme = modes_at_rest(stepper, parameters), stepper.scheme
    if _growth(METHODS[scheme.method], modes, scheme.substeps) <= 1.0 + GROWTH:
        return
    enough = _enough_substeps(scheme.method, modes)
    advice = f"use substeps >= {enough}" if enough else "use another method (dop853)"
    raise ValueError(
        f"substeps = {scheme.substeps} ({scheme.method}, {1e3 * DT / scheme.substeps:g} ms): unstable for"
        f" this robot, whose fastest mode is at {np.abs(modes).max():.0f} 1/s; {advice}"
    )


def stable_scheme(robot: Robot) -> Scheme:
    """The default scheme of a robot, with more substeps if its own modes need them."""
    scheme = default_scheme(robot.links)
    stepper = Stepper(robot.structure, scheme, compiled=False)
    enough = _enough_substeps(scheme.method, modes_at_rest(stepper, stepper.parameters(robot)))
    if enough is None:
        raise ValueError(
            f"robot: a mode is too fast for {MAX_SUBSTEPS} substeps of {scheme.method} in {DT} s"
        )
    return replace(scheme, substeps=max(scheme.substeps, enough))


def _enough_substeps(method: str, modes: Modes) -> int | None:
    """Smallest stable number of steps in a command period."""
    numbers = range(1, MAX_SUBSTEPS + 1)
    return next((k for k in numbers if _growth(METHODS[method], modes, k) <= 1.0 + GROWTH), None)


def modes_at_rest(stepper: Stepper, parameters: Array) -> Modes:
    """Eigenvalues [1/s] of the motion linearised about rest with a straight tail."""
    size = len(stepper.layout.motion)
    rest = np.tile(stepper.rest()[:size], (size, 1))
    still = np.zeros((size, 4))
    p = np.tile(parameters, (size, 1))
    _, columns = stepper.rates_jvp(rest, still, p, np.eye(size), still, np.zeros_like(p))
    return np.linalg.eigvals(columns.T).astype(complex)


def _growth(method: Method, modes: Modes, substeps: int) -> float:
    decaying = modes[modes.real <= GROWTH]
    return max(abs(_stability_function(method, s * DT / substeps)) for s in decaying)


def _stability_function(method: Method, z: complex) -> complex:
    """R(z) = 1 + z b (1 - z A)^-1 (1, .., 1)."""
    A, ones = np.array(method.A), np.ones(len(method.B))
    return complex(1.0 + z * np.dot(method.B, np.linalg.solve(np.eye(len(ones)) - z * A, ones)))
