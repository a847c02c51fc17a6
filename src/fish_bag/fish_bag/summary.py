# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Counts, rates, gaps and latencies of every topic in a recording, mapped or not."""

from __future__ import annotations

import numpy as np

from fish_bag.bag import RawTopic
from fish_bag.trial import TopicSummary


def summarise(
    raw: RawTopic, role: str, t: np.ndarray, t_arrival: np.ndarray, stamped: np.ndarray
) -> TopicSummary:
    """One topic; `t` is the moment of measurement, or the arrival of messages that are not stamped (N,)."""
    steps = np.diff(np.sort(t))
    span = float(np.sum(steps))
    ages = (t_arrival - t)[stamped]
    latency = np.quantile(ages, [0.01, 0.5, 0.99]) if len(ages) else [np.nan] * 3
    return TopicSummary(
        topic=raw.topic,
        type=raw.type,
        count=len(t),
        rate_hz=(len(t) - 1) / span if span > 0 else np.nan,
        period_s=float(np.median(steps)) if len(steps) else np.nan,
        longest_gap_s=float(steps.max()) if len(steps) else np.nan,
        latency_s=(float(latency[0]), float(latency[1]), float(latency[2])),
        role=role,
        stamped=bool(stamped.any()),
    )
