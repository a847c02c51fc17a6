# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Numbers that are not finite: refused before a step, found after a rollout.

The stepper refuses commands, parameters and a single start state that are not finite. In a batch an element that
starts or becomes non-finite stays so and leaves the others alone; `diverged` tells which.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

FINITE_LIMIT = 1e6  # SI units; no state of a swimming fish comes near


def check_finite(what: str, array: Array, names: Sequence[str]) -> None:
    """Raise ValueError with name, batch index and value of the first entry of array (..., len(names)) not finite."""
    if np.isfinite(array).all():
        return
    bad = np.argwhere(~np.isfinite(array))
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
