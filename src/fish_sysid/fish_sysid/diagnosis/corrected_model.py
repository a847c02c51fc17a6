"""What a diagnosis comes to: which names stand, whether much is left, which robot to go on with."""

from __future__ import annotations

import numpy as np

from fish_sysid.diagnosis.result import Accepted, Diagnosis
from fish_sysid.diagnosis.vocabulary import kind_of
from fish_sysid.estimation.global_fit import TOO_STRONG, excess
from fish_sysid.estimation.map_fit import Fit


def verdict(d: Diagnosis) -> str:
    """no_mismatch, missing_physics, sensor_or_actuator or unexplained."""
    found = named(d)
    if not found:
        return "unexplained" if much_is_left(d) else "no_mismatch"
    kinds = {kind_of(a.name) for a in found}
    return "missing_physics" if "physics" in kinds else "sensor_or_actuator"


def much_is_left(d: Diagnosis) -> bool:
    """The wrench that remains is far stronger than water, or follows a law on trials that the law has not seen."""
    return bool(excess(d.final).max() > TOO_STRONG or d.description.lawful(d.level))


def named(d: Diagnosis) -> tuple[Accepted, ...]:
    """The accepted effects, or none where they leave more than they take away: nearest is not right."""
    return () if much_is_left(d) and unexplained_share(d) > 0.5 else d.accepted


def unexplained_share(d: Diagnosis) -> float:
    """Part of the mismatch that is still there: densities of the wrench beyond those of usual water."""
    final, nominal = excess(d.final), excess(d.nominal)
    left, removed = np.sum(np.maximum(final - 1.0, 0.0)), np.sum(np.maximum(nominal - final, 0.0))
    return float(left / (left + removed)) if left + removed > 0 else 0.0


def corrected(d: Diagnosis) -> Fit:
    """The fit that model.yaml holds."""
    if d.outlook is not None:
        return d.outlook
    return d.final if named(d) else d.nominal
