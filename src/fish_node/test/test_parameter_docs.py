# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Descriptions and ranges from a dataclass of parameters."""

from dataclasses import dataclass

import pytest

from fish_node.frames import require_frame, require_frame_prefix
from fish_node.parameter_docs import ParameterDoc, interval, parameter_docs


@dataclass(frozen=True)
class Base:
    rate: float = 2.0  # Hz, of nothing

    def __post_init__(self) -> None:
        if not 1.0 <= self.rate <= 5.0:
            raise ValueError(f"rate is {self.rate}, expected 1 to 5 Hz")


@dataclass(frozen=True)
class Settings(Base):
    fast: float = 3.0  # Hz, at least rate
    count: int = 1  # of things
    mode: str = "a"  # a or b
    on: bool = False  # whether
    free: float = 0.0  # anything

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.rate <= self.fast <= 9.0:
            raise ValueError(f"fast is {self.fast}, expected {self.rate} to 9 Hz")
        if self.count < 1:
            raise ValueError(f"count is {self.count}, expected at least 1")
        if self.mode not in ("a", "b"):
            raise ValueError(f"mode is {self.mode!r}; known: a, b")


def test_a_field_s_comment_is_its_description_and_its_refusal_its_range() -> None:
    assert parameter_docs(Settings()) == {
        "rate": ParameterDoc("Hz, of nothing", "1 to 5 Hz", (1.0, 5.0)),
        "fast": ParameterDoc("Hz, at least rate", "2.0 to 9 Hz", (2.0, 9.0)),
        "count": ParameterDoc("of things", "at least 1", (1.0, float("inf"))),
        "mode": ParameterDoc("a or b", "a, b", None),
        "on": ParameterDoc("whether", "true, false", None),
        "free": ParameterDoc("anything", "", None),
    }


def test_a_range_that_depends_on_another_value_follows_it() -> None:
    assert parameter_docs(Settings(rate=3.0, fast=4.0))["fast"].interval == (3.0, 9.0)


@pytest.mark.parametrize(
    ("said", "bounds"),
    [
        ("0.05 to 0.5 m/s", (0.05, 0.5)),
        ("-1 to 1e-06", (-1.0, 1e-6)),
        ("0.005 < lookahead <= 2.0", (0.005, 2.0)),
        ("> -0.5", (-0.5, float("inf"))),
        ("1, -1", None),
        ("three numbers", None),
    ],
)
def test_bounds_are_read_from_words(said: str, bounds: tuple[float, float] | None) -> None:
    assert interval(said) == bounds


@pytest.mark.parametrize("prefix", ["fish_2", "/fish/", "a b/", "2/"])
def test_a_wrong_prefix_is_refused(prefix: str) -> None:
    require_frame_prefix("")
    require_frame_prefix("lab/fish_2/")
    with pytest.raises(ValueError, match="end with a slash, such as 'fish_2/'"):
        require_frame_prefix(prefix)


@pytest.mark.parametrize("frame", ["", "/pool", "the pool"])
def test_a_wrong_frame_is_refused(frame: str) -> None:
    require_frame("pool_frame", "fish_2/base_link")
    with pytest.raises(ValueError, match=r"pool_frame is .*without a slash in front"):
        require_frame("pool_frame", frame)
