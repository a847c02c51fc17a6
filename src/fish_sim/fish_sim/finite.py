# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Numbers that are not finite, found and named."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray


def check_finite(what: str, array: NDArray[np.float64], names: Sequence[str]) -> None:
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
