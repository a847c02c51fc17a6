# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Verb latency on recordings as they are read."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fish_bag.trial import Camera, Imu, Trial
from fish_bringup.verbs.latency import measured, table


def stream(t, delay):
    return {
        "topic": "",
        "frame_id": "",
        "t": t,
        "t_arrival": t + delay,
        "flags": np.zeros(len(t), dtype=np.uint8),
    }


def heading(t):
    return 0.2 * np.sin(4.0 * np.pi * t) * (1.0 + 0.3 * np.sin(0.7 * t)) + 0.3 * np.sin(0.8 * t)


def recording(late):
    """A trial whose camera stamps are `late` s later than the exposure; the gyro measures, the orientation does not."""
    t, exposed = np.arange(0.0, 30.0, 0.01), np.arange(0.0, 30.0, 1.0 / 30.0)
    gyro = np.column_stack([0.0 * t, 0.0 * t, np.gradient(heading(t), t)])
    imu = Imu(
        **stream(t, 0.01), gyro=gyro, accel=0.0 * gyro, orientation=np.full((len(t), 4), np.nan)
    )
    seen = heading(exposed) + np.random.default_rng(2).normal(0.0, 0.01, len(exposed))
    camera = Camera(
        **stream(exposed + late, 0.05),
        x=0.0 * seen,
        y=0.0 * seen,
        psi=seen,
        covariance=np.zeros((len(seen), 3, 3)),
    )
    return Trial("swim", Path("swim"), 0, 30.0, "/fish", "recorder", imu=imu, camera=camera)


def test_the_offset_stands_in_the_table():
    found = measured(recording(0.3))
    assert found.estimate.offset == pytest.approx(-0.3, abs=0.003)
    assert found.age == pytest.approx(0.34, abs=0.005)
    row = table([("swim", found)]).rows[0]
    assert row[0] == "swim"
    assert float(row[1]) == pytest.approx(-0.3, abs=0.003)
    assert row[-1] == "yes"


@pytest.mark.parametrize(("field", "topic"), [("imu", "imu/data"), ("camera", "camera/pose")])
def test_a_missing_sensor_is_named(field, topic):
    with pytest.raises(ValueError, match=f"swim: no {topic}"):
        measured(replace(recording(0.1), **{field: None}))
