# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Two publishers on one topic: values that jump between two sources."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields

import numpy as np

from fish_bag.problem import Problem
from fish_bag.trial import NOT_FINITE, UNREADABLE, Commands, Stream

FEWEST = 40  # samples
ALTERNATES = 2.0  # steps to the next sample against those to the one after it; 0.5 where values change steadily, 1 for noise
ALONE = 0.05  # share of commands that lie apart from both neighbours


def check_publishers(stream: Stream) -> Iterator[Problem]:
    """A warning if the samples of a stream come from two sources."""
    usable = stream.take(np.flatnonzero(stream.flags & (NOT_FINITE | UNREADABLE) == 0))
    if len(usable) < FEWEST:
        return
    named = {
        field.name: getattr(usable, field.name)
        for field in fields(usable)
        if field.name not in ("t", "t_arrival", "flags", "covariance")
    }
    columns = {k: v for k, v in named.items() if isinstance(v, np.ndarray) and v.dtype.kind == "f"}
    jumping = [name for name, values in columns.items() if _jumps(values, name == "psi")]
    if isinstance(stream, Commands):
        jumping += [k for k, v in columns.items() if k not in jumping and _lies_alone(v)]
    if not jumping:
        return
    span = float(np.ptp(usable.t))
    rate = f"{(len(usable) - 1) / span:.0f} Hz" if span > 0 else "no rate"
    text = f"{', '.join(jumping)} jump between two sources at {rate}: do two nodes publish it?"
    yield Problem("warning", "two_publishers", stream.topic, text)


def _jumps(values: np.ndarray, angle: bool) -> bool:
    """Whether every other sample is of another source."""
    steps = [np.diff(values, axis=0), values[2:] - values[:-2]]
    if angle:
        steps = [np.mod(step + np.pi, 2 * np.pi) - np.pi for step in steps]
    near, far = (
        float(np.nanmean(np.abs(step))) if np.isfinite(step).any() else 0.0 for step in steps
    )
    return near > ALTERNATES * far and near > 0


def _lies_alone(values: np.ndarray) -> bool:
    """Whether single samples lie apart from neighbours that agree with each other."""
    middle, apart = 0.5 * (values[2:] + values[:-2]), np.abs(values[2:] - values[:-2])
    scale = 0.05 * float(np.nanstd(values))
    alone = np.abs(values[1:-1] - middle) > 5 * (apart + scale)
    return bool(np.mean(alone) > ALONE) and scale > 0
