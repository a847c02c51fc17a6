# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Verb latency on recordings as they are read."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fish_bag.trial import Camera, Imu, Trial
from fish_bringup.verbs.latency import measured, table, together
from fish_control.offset_sums import ClockEstimate


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


def recording(late, lead=None):
    """A trial whose camera stamps are `late` s later than the exposure; the orientation leads the gyro, or measures nothing."""
    t, exposed = np.arange(0.0, 30.0, 0.01), np.arange(0.0, 30.0, 1.0 / 30.0)
    gyro = np.column_stack([0.0 * t, 0.0 * t, np.gradient(heading(t), t)])
    orientation = np.full((len(t), 4), np.nan)
    if lead is not None:
        half = 0.5 * heading(t + lead)
        orientation = np.column_stack([0.0 * t, 0.0 * t, np.sin(half), np.cos(half)])
        gyro *= 0.7
    imu = Imu(**stream(t, 0.01), gyro=gyro, accel=0.0 * gyro, orientation=orientation)
    seen = heading(exposed) + np.random.default_rng(2).normal(0.0, 0.01, len(exposed))
    camera = Camera(
        **stream(exposed + late, 0.05),
        x=0.0 * seen,
        y=0.0 * seen,
        psi=seen,
        covariance=np.zeros((len(seen), 3, 3)),
    )
    return Trial("swim", Path("swim"), 0, 30.0, "/fish", "recorder", imu=imu, camera=camera)


def shown(found):
    """What the table says of one recording, by column."""
    page = table([("swim", found)])
    return dict(zip(page.header, page.rows[0], strict=True))


def test_the_offset_stands_in_the_table():
    found = measured(recording(0.3))
    assert found.recorded.estimate.offset == pytest.approx(-0.3, abs=0.003)
    assert found.recorded.age == pytest.approx(0.34, abs=0.005)
    row = shown(found)
    assert row["recording"] == "swim"
    assert float(row["offset s"]) == pytest.approx(-0.3, abs=0.003)
    assert float(row["lead s"]) == pytest.approx(0.0, abs=0.001)
    assert row["sure"] == "yes"


def test_an_orientation_that_leads_the_gyro_is_named_and_the_offset_said_to_both():
    row = shown(measured(recording(0.3, lead=0.015)))
    assert float(row["lead s"]) == pytest.approx(0.015, abs=0.002)
    assert float(row["offset s"]) == pytest.approx(-0.315, abs=0.003)
    assert float(row["to gyro s"]) == pytest.approx(-0.3, abs=0.003)


def test_recordings_that_differ_say_so():
    at = [ClockEstimate(o, 0.001, True) for o in (-0.30, -0.31, -0.32)]
    assert "differ by" in together(at)
    assert "differ" not in together(at[:1])


@pytest.mark.parametrize(("field", "topic"), [("imu", "imu/data"), ("camera", "camera/pose")])
def test_a_missing_sensor_is_named(field, topic):
    with pytest.raises(ValueError, match=f"swim: no {topic}"):
        measured(replace(recording(0.1), **{field: None}))
