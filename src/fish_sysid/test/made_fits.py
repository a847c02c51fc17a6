# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Fits with chosen numbers, for tests of decisions between them."""

from __future__ import annotations

import numpy as np

from fish_sim.robot import Robot
from fish_sysid.estimation.ekf_types import FilterResult, Noise
from fish_sysid.estimation.map_fit import Fit
from fish_sysid.estimation.parametrization import Hypothesis, nominal_hypothesis


def hypothesis(*names: str, links: int = 1) -> Hypothesis:
    """One nominal parameter free, and these effects."""
    made = nominal_hypothesis(Robot(links=links), ("head_drag_surge",))
    for name in names:
        made = made.with_effect(name)
    return made


def made_fit(
    log_posterior: float,
    *names: str,
    ratio: float = 1.0,
    theta: np.ndarray | None = None,
    information: np.ndarray | None = None,
    noise: Noise | None = None,
    samples: float = 1000.0,
) -> Fit:
    """A fit of one trial with these effects; ratio: of process noise. Its evidence rises with its log posterior."""
    structure = hypothesis(*names)
    count = len(structure.free)
    result = FilterResult(
        np.array([log_posterior]),
        np.array([samples]),
        np.zeros((1, count)),
        np.zeros((1, count, count)),
        np.zeros((1, 1, 7)),
        None,
    )
    return Fit(
        structure,
        np.zeros(count) if theta is None else theta,
        structure.robot,
        (noise or Noise()).with_wrench(ratio**0.5),
        result.log_likelihood,
        log_posterior,
        result,
        np.eye(count) if information is None else information,
    )
