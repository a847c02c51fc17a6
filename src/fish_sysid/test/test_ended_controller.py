# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What a servo does whose controller has ended, an IMU that is late, and what a recording lacks."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fish_sim.model import DT
from fish_sim.robot import Robot
from fish_sysid.dataset.commands import held_rudder
from fish_sysid.dataset.experiment import Headings
from fish_sysid.dataset.imu import imu_moved_back
from fish_sysid.dataset.synthetic import program, record
from fish_sysid.estimation.ekf_types import Noise
from fish_sysid.identification_statements import incomplete


def commands(end: int = 300) -> tuple[np.ndarray, np.ndarray]:
    """Rotor that stands and rudder that is 0 from a grid point on, as the log of a controller that has ended says."""
    k = np.arange(500)
    rotor = np.where(k < end, 60.0 * np.sin(0.1 * k), 40.0)
    return rotor, np.where(k < end, -0.3, 0.0)


def test_a_servo_keeps_its_last_command_when_the_controller_has_ended() -> None:
    rotor, rudder = commands()
    assert held_rudder(rotor, rudder) == pytest.approx(np.full(500, -0.3))


def test_a_rudder_that_is_told_to_centre_is_centred() -> None:
    rotor, rudder = commands()
    swimming = 60.0 * np.sin(0.1 * np.arange(500))
    assert (held_rudder(swimming, rudder) == rudder).all()
    assert (held_rudder(np.where(rotor == 40.0, 0.0, rotor), rudder) == rudder).all()
    moved = rudder.copy()
    moved[450] = 0.1
    assert (held_rudder(rotor, moved) == moved).all()
    early = np.where(np.arange(500) < 200, -0.3, 0.0)
    assert (held_rudder(rotor, early) == early).all()


def test_imu_readings_go_back_to_when_they_were_taken() -> None:
    random = np.random.default_rng(0)
    told = program("sines", 4.0, random)[:, None]
    made, true = record(Robot(), told, Noise(gyro=1e-9), random)
    late = replace(
        made,
        gyro=np.concatenate([np.full((3, 1), np.nan), made.gyro[:-3]]),
        headings=(Headings(DT * np.arange(400) + 0.03, true.state[:, 0, 2]),),
    )
    back = imu_moved_back(late, 0.03)
    assert back.gyro[:-3] == pytest.approx(made.gyro[:-3])
    assert np.isnan(back.gyro[-3:]).all()
    assert back.headings[0].t == pytest.approx(DT * np.arange(400))


def test_what_a_trial_lacks_is_said_of_that_trial() -> None:
    random = np.random.default_rng(0)
    told = np.stack([program(kind, 6.0, random) for kind in ("straight", "sines")], axis=1)
    made, _ = record(Robot(), told, Noise(), random)
    gyro = made.gyro.copy()
    gyro[:130, 1] = np.nan
    texts = incomplete(replace(made, gyro=gyro))
    assert any(t.startswith("synthetic_01: no IMU from 0.0 to 1.3 s") for t in texts)
    assert any(t.startswith("synthetic_00: turns by") for t in texts)
    assert not any(t.startswith("synthetic_00: no") for t in texts)
