"""Trials a few at a time: a pass with many derivatives, or one that keeps its history, holds kilobytes of every 10 ms.

A law of what a rudder's delay leaves took 3.5 GB on 27 trials of 20 s that went through at once; so it takes 0.5.
"""

from __future__ import annotations

from fish_sysid.dataset.experiment import Experiment

STEPS_AT_ONCE = 8000  # grid points of 10 ms: four trials of 20 s


def portions(experiment: Experiment) -> list[list[int]]:
    """Indices of trials in groups of so many grid points, as long as their longest trial has; one trial at least."""
    count, trials = max(1, STEPS_AT_ONCE // experiment.length), len(experiment.names)
    return [list(range(first, min(first + count, trials))) for first in range(0, trials, count)]
