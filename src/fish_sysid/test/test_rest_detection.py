# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Rest at a trial's start: strokes that begin at once do not speak against it, a glide that the gyro does not feel does."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fish_sim.model import DT
from fish_sim.robot import Robot
from fish_sysid.dataset.experiment import Experiment, Frames
from fish_sysid.dataset.grid import starts_at_rest
from fish_sysid.dataset.synthetic import (
    FULL_SPEED,
    KINDS,
    STROKE,
    program,
    record,
)
from fish_sysid.estimation.ekf_types import Noise


@pytest.fixture(scope="module")
def pushed_off() -> Experiment:
    """Full strokes from the first sample on, with the rudder turned."""
    strokes = FULL_SPEED * np.sin(2.0 * np.pi * STROKE * DT * np.arange(300) + 0.3)
    commands = np.stack([np.column_stack([strokes, np.full(300, 0.6)])] * 5, axis=1)
    return record(Robot(), commands, Noise(), np.random.default_rng(4))[0]


@pytest.fixture(scope="module")
def glided() -> Experiment:
    """A fish that swam, and since half a second has not been told anything."""
    random = np.random.default_rng(1)
    before = np.concatenate([program("straight", 4.0, random) * [1.5, 1.0], np.zeros((150, 2))])
    commands = np.stack(
        [np.concatenate([before, program(kind, 3.0, random)]) for kind in KINDS], axis=1
    )
    made, first = record(Robot(), commands, Noise(), random)[0], len(before) - 50
    arrays = {key: getattr(made, key)[first:] for key in ("commands", "gyro", "accel", "encoder")}
    seen = [f.t >= DT * first for f in made.frames]
    frames = tuple(
        Frames(f.t[s] - DT * first, f.pose[s]) for f, s in zip(made.frames, seen, strict=True)
    )
    return replace(made, steps=made.steps - first, frames=frames, **arrays)


def found(e: Experiment) -> list[bool]:
    return [
        starts_at_rest(e.gyro[:, m], e.accel[:, m], e.encoder[:, m], f.t, f.pose)
        for m, f in enumerate(e.frames)
    ]


@pytest.mark.parametrize("delay", [0.0, 0.05, 0.1, 0.2])
def test_strokes_from_rest_are_no_glide_though_the_image_is_old(
    pushed_off: Experiment, delay: float
) -> None:
    """Images show rest until the delay is over; the accelerometer feels the strokes at once."""
    frames = []
    for f in pushed_off.frames:
        rest = np.arange(0.001, delay, 1 / 30)
        still = f.pose[:1].repeat(len(rest), axis=0)
        frames.append(Frames(np.concatenate([rest, f.t + delay]), np.concatenate([still, f.pose])))
    assert all(found(replace(pushed_off, frames=tuple(frames))))


def test_strokes_push_a_fish_at_rest_as_far_as_a_glide(pushed_off: Experiment) -> None:
    """Only the accelerometer tells them apart."""
    without = replace(pushed_off, accel=np.full_like(pushed_off.accel, np.nan))
    assert not all(found(without))


def test_a_glide_is_no_rest_though_nothing_turns(glided: Experiment) -> None:
    assert np.abs(glided.gyro[0]).max() < 0.1
    assert np.abs(glided.encoder[0]).max() < 1.0
    assert not any(found(glided))
    blind = np.full_like(glided.accel, np.nan)
    assert not any(found(replace(glided, accel=blind)))


def test_a_rotor_or_a_fish_that_turns_is_no_rest_and_who_does_not_see_believes_the_others(
    pushed_off: Experiment,
) -> None:
    encoder, gyro = pushed_off.encoder.copy(), pushed_off.gyro.copy()
    encoder[0, 0], encoder[0, 1], gyro[0, 2], gyro[0, 3] = 20.0, np.nan, 0.3, np.nan
    assert found(replace(pushed_off, encoder=encoder, gyro=gyro)) == [
        False,
        True,
        False,
        False,
        True,
    ]
    late = tuple(Frames(f.t + 1.0, f.pose) for f in pushed_off.frames)
    assert all(found(replace(pushed_off, frames=late)))
