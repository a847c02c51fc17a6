# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What to ask after a rollout: what diverged.

The stepper refuses commands, parameters and a single start state that are not finite. In a batch an element that
starts or becomes non-finite stays so and leaves the others alone; `diverged` tells which.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

FINITE_LIMIT = 1e6  # SI units; no state of a swimming fish comes near


def diverged(states: Array) -> NDArray[np.bool_]:
    """Which batch elements of states (T + 1, ..., NS) left the finite world: (...)."""
    finite: NDArray[np.bool_] = np.all(np.abs(states) < FINITE_LIMIT, axis=(0, -1))
    return ~finite
