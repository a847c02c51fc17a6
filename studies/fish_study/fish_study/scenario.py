# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""A scenario: what is hidden in one data set. Its JSON is the label that is committed to."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

Values = Mapping[str, Mapping[str, float]]  # name -> parameter -> value


class ScenarioError(ValueError):
    """A scenario that cannot be made, now or again; the message says why."""


@dataclass(frozen=True)
class Scenario:
    """Everything a data set is made from, numbers drawn; `seed` draws the rest (programs, noise)."""

    group: str
    seed: int
    effects: Values = field(
        default_factory=dict
    )  # concealed: vocabulary, `outside.OUTSIDE` or the plant's own
    strength: float = 1.0  # in typical ones
    trials: str = "mixed"  # mixed (8 open loop, 4 closed), closed, one_speed
    count: int = 12  # trials
    duration: float = 20.0  # s of each
    noise: float = 1.0  # factor on all standard deviations of water and sensors
    encoder: bool = True  # recorded
    plant: str = "fish_sim"  # or mujoco
    links: int = 3
    method: str = "dop853"  # not the integrator that the tool uses
    substeps: int = 2
    parameters: Mapping[str, float] = field(default_factory=dict)  # factors on nominal parameters
    old: int = 0  # trials of a baseline without what is concealed; 0: there is none
    recordings: str = ""  # folder of a user's recordings, in some of which it is put; "": a plant

    @property
    def names(self) -> tuple[str, ...]:
        """What is hidden."""
        return tuple(self.effects)

    def label(self) -> dict[str, Any]:
        """Plain data."""
        return asdict(self)

    @property
    def pair(self) -> bool:
        """Whether the tool is asked what changed against a baseline."""
        return self.old > 0 or bool(self.recordings)

    @classmethod
    def of(cls, label: Mapping[str, Any]) -> Scenario:
        """The scenario of a label."""
        return cls(**label)
