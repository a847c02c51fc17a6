# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What a symmetry test answers: found, not found, or why the recordings cannot tell."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

Status = Literal["found", "not found", "cannot tell"]


@dataclass(frozen=True)
class Estimate:
    """A parameter with its standard error, by the jackknife over trials."""

    value: float
    std: float
    unit: str

    def __str__(self) -> str:
        return f"{self.value:.3g} ± {self.std:.2g}" + ("" if self.unit == "1" else f" {self.unit}")


@dataclass(frozen=True)
class Evidence:
    """How much better trials are predicted that took no part in the fit."""

    gain: float  # mean over left-out trials of log(mean square without / mean square with)
    std: float  # standard error of that mean
    p_value: float  # one-sided Student test of a gain of zero or less


@dataclass(frozen=True)
class SymmetryFinding:
    """The answer of one test.

    `stands_alone` is False where the test rests on the fish's mirror symmetry, which a real hull may lack: such a finding is
    shown and never stated as an effect.
    """

    name: str  # of the vocabulary, or a description in words
    kind: str  # physics, actuator or sensor
    status: Status
    assumes: str
    needs: str
    reason: str = ""  # of "cannot tell"
    statement: str = ""  # of "found", in words
    parameters: Mapping[str, Estimate] = field(default_factory=dict)
    evidence: Evidence | None = None
    stands_alone: bool = True


@dataclass(frozen=True)
class SymmetryTest:
    """What stands in every answer of one test; fields as in `SymmetryFinding`."""

    name: str
    kind: str
    assumes: str
    needs: str
    stands_alone: bool = True

    def cannot_tell(self, reason: str) -> SymmetryFinding:
        """The answer where the recordings cannot tell."""
        return self._finding("cannot tell", reason=reason)

    def answer(
        self,
        found: bool,
        statement: str,
        parameters: Mapping[str, Estimate],
        evidence: Evidence | None = None,
    ) -> SymmetryFinding:
        """Found, as the statement says, or not found."""
        status: Status = "found" if found else "not found"
        said = statement if found else ""
        return self._finding(status, statement=said, parameters=parameters, evidence=evidence)

    def _finding(self, status: Status, **content: Any) -> SymmetryFinding:
        own = self.name, self.kind, status, self.assumes, self.needs
        return SymmetryFinding(*own, stands_alone=self.stands_alone, **content)
