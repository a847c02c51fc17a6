# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The symmetry tests of a diagnosis as a table."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from fish_report.page import Table
from fish_sysid.diagnosis.symmetry.finding import Estimate

HEADER = ("test for", "answer", "numbers", "log gain on left-out trials", "assumes", "needs")
NOTE = (
    "Symmetries that no fish can break are broken by the pool, a clock or a sensor only, so these tests need no model of the "
    "fish. Log gain: logarithm of the mean square without the effect over that with it, on trials that took no part in the fit, "
    "with its standard error. Tests that assume a mirror-symmetric fish are shown and name nothing."
)


def symmetry_table(tests: Sequence[Mapping[str, Any]], title: str = "Symmetry tests") -> Table:
    """Every test of diagnosis.json's `symmetry`."""
    return Table(title, HEADER, [_row(test) for test in tests], NOTE)


def _row(test: Mapping[str, Any]) -> list[str]:
    numbers = ", ".join(f"{key} {Estimate(**p)}" for key, p in test["parameters"].items())
    told = test["evidence"]
    gain = ""
    if told:
        gain = f"{told['left_out_log_gain']:.2f} ± {told['left_out_log_gain_std']:.2f}"
    answer = ": ".join(part for part in (test["status"], test["reason"]) if part)
    return [test["name"], answer, numbers, gain, test["assumes"], test["needs"]]
