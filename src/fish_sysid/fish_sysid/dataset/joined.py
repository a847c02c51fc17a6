# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Several days' trials side by side."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from fish_sysid.dataset.experiment import NO_HEADINGS, Experiment


def joined(days: Sequence[Experiment]) -> Experiment:
    """All trials of these experiments; the names of those after the first day get its number where they are taken."""
    if len(days) == 1:
        return days[0]
    longest = max(day.length for day in days)
    arrays = {}
    for key in ("commands", "gyro", "accel", "encoder"):
        filler = 0.0 if key == "commands" else np.nan
        padded = [
            np.concatenate([a, np.full((longest - len(a), *a.shape[1:]), filler)])
            for a in (getattr(day, key) for day in days)
        ]
        arrays[key] = np.concatenate(padded, axis=1)
    names: list[str] = []
    for number, day in enumerate(days, 1):
        names += [f"{name} of day {number}" if name in names else name for name in day.names]
    return replace(
        days[0],
        names=tuple(names),
        steps=np.concatenate([day.steps for day in days]),
        frames=tuple(f for day in days for f in day.frames),
        headings=tuple(
            h for day in days for h in (day.headings or (NO_HEADINGS,) * len(day.names))
        ),
        start_at_rest=all(day.start_at_rest for day in days),
        **arrays,
    )
