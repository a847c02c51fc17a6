# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""How far start states trust camera, IMU and older samples: as far as predictions of the training trials ask for.

A model that lacks something leaves its start state between what the sensors say now and what they said a second ago. Which of
them is right more often is no property of the sensors. It is found with the fit: each scale is halved or doubled as long as
stroke means 0.5 to 5 s ahead get better. Only training trials take part.
"""

from __future__ import annotations

from dataclasses import replace

from fish_sysid.dataset.experiment import Experiment
from fish_sysid.estimation.shooting.residuals import Scale
from fish_sysid.estimation.shooting.schedule import FINE, Found, multistep

FACTORS = (0.5, 2.0)
SWEEPS = 3  # over all scales
WORTH = 0.003  # of the cost; a change that gains less is none
MOVING = ("position", "heading", "orientation", "fading")
SLOWEST = 4.0  # s; beyond it an older sample counts as much as a new one


def trusted(experiment: Experiment, found: Found, every: float = FINE) -> Found:
    """The fit with the trust under which it predicts these trials best."""

    def cost(trust: Scale) -> float:
        return multistep(experiment, replace(found, trust=trust), every).cost(found.z)

    best, trust = cost(found.trust), found.trust
    for _ in range(SWEEPS):
        before = best
        for name in MOVING:
            for factor in FACTORS:
                tried = replace(trust, **{name: factor * getattr(trust, name)})
                if tried.fading <= SLOWEST and (other := cost(tried)) < (1.0 - WORTH) * best:
                    best, trust = other, tried
                    break
        if best == before:
            break
    return replace(found, trust=trust)
