# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What a diagnosis comes to: which names stand, whether much is left, which robot to go on with."""

from __future__ import annotations

import numpy as np

from fish_sysid.diagnosis.result import Accepted, Diagnosis
from fish_sysid.diagnosis.vocabulary import kind_of
from fish_sysid.estimation.map_fit import Fit
from fish_sysid.estimation.thresholds import MOST_UNEXPLAINED, RATIO_REJECT


def verdict(d: Diagnosis) -> str:
    """no_mismatch, missing_physics, sensor_or_actuator or unexplained."""
    found = named(d)
    if not found:
        return "unexplained" if much_is_left(d) else "no_mismatch"
    kinds = {kind_of(a.name, d.task.robot.table) for a in found}
    return "missing_physics" if "physics" in kinds else "sensor_or_actuator"


def much_is_left(d: Diagnosis) -> bool:
    """The wrench that remains is far stronger than water, or follows a law on trials that the law has not seen."""
    return d.final.largest_ratio > RATIO_REJECT or bool(d.state.law.lawful(d.task.level))


def named(d: Diagnosis) -> tuple[Accepted, ...]:
    """The accepted effects, or none where they leave more than they take away: nearest is not right."""
    return () if much_is_left(d) and unexplained_share(d) > MOST_UNEXPLAINED else d.accepted


def unexplained_share(d: Diagnosis) -> float:
    """Part of the mismatch that is still there: densities of the wrench beyond those of usual water."""
    final, nominal = d.final.process_noise_ratio, d.nominal.process_noise_ratio
    left, removed = np.sum(np.maximum(final - 1.0, 0.0)), np.sum(np.maximum(nominal - final, 0.0))
    return float(left / (left + removed)) if left + removed > 0 else 0.0


def corrected(d: Diagnosis) -> Fit:
    """The fit that model.yaml holds."""
    if d.surrogate is not None:
        return d.surrogate
    return d.final if named(d) else d.nominal
