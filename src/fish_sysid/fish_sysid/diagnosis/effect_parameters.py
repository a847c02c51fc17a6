# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""An effect's parameters as plain data."""

from __future__ import annotations

from typing import Any

from fish_sysid.estimation.map_fit import Fit


def effect_parameters(fit: Fit, name: str) -> dict[str, dict[str, Any]]:
    """Values, standard errors and units of an effect's parameters."""
    values, errors = fit.values, fit.standard_errors
    return {
        key: {
            "value": values[f"{name}.{key}"],
            "std": errors[f"{name}.{key}"],
            "unit": parameter.unit,
        }
        for key, parameter in fit.hypothesis.effect(name).parameters.items()
    }
