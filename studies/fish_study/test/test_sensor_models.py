# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What the sensors make of the true motion, and when a command source sees it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from prove_samples import small

from fish_bag import read_dataset
from fish_sim.sensors.noise_levels import CAMERA_LATENCY
from fish_study.build import make_readings, make_recordings
from fish_study.oracle import as_experiment, with_truth
from fish_study.sensor_models import SensorErrors, SensorModels
from fish_study.swim import Inertial, swim
from fish_sysid.dataset.experiment import build_experiment
from fish_sysid.estimation.ekf_types import Noise
from fish_sysid.estimation.map_fit import evaluate
from fish_sysid.estimation.parametrization import SENSOR_FIELDS


def test_recordings_say_what_the_instruments_read(tmp_path) -> None:
    scenario = small("single", encoder=True)
    make_recordings(scenario, tmp_path / "set")
    data = read_dataset(tmp_path / "set")
    assert not [p for trial in data for p in trial.problems if p.severity != "info"]
    assert np.diff([trial.origin_ns for trial in data]).min() > 1e9 * scenario.duration
    read, direct = build_experiment(list(data)), as_experiment(make_readings(scenario), True)
    for key in ("commands", "gyro", "accel", "encoder"):
        assert np.allclose(
            getattr(read, key)[:-1],
            getattr(direct, key)[: len(read.commands) - 1],
            atol=1e-9,
            equal_nan=True,
        )
    for a, b in zip(read.frames, direct.frames, strict=True):
        turns = np.round((a.pose - b.pose) / (2.0 * np.pi)) * [
            0.0,
            0.0,
            2.0 * np.pi,
        ]  # a heading may wrap elsewhere
        assert np.allclose(a.t, b.t, atol=1e-8)
        assert np.allclose(a.pose - turns, b.pose, atol=1e-9)
    for trial in data:
        latency = {
            s: np.median(getattr(trial, s).t_arrival - getattr(trial, s).t)
            for s in ("camera", "imu", "encoder")
        }
        assert latency == pytest.approx({"camera": 0.05, "imu": 0.002, "encoder": 0.001}, abs=1e-6)
        turned, rotor = (
            np.diff(trial.encoder.angle),
            0.005 * (trial.encoder.speed[1:] + trial.encoder.speed[:-1]),
        )
        np.testing.assert_allclose(turned, rotor, atol=1e-9)
        yaw = np.unwrap(2.0 * np.arctan2(trial.imu.orientation[:, 2], trial.imu.orientation[:, 3]))
        np.testing.assert_allclose(np.diff(yaw), 0.01 * trial.imu.gyro[1:, 2], atol=1e-9)


def test_recordings_are_as_noisy_as_the_filter_takes_them_to_be() -> None:
    """With the true parameters innovations are white: sensors, biases, the water's push and the true fish all agree."""
    scenario = replace(small("null", encoder=True), count=4, duration=8.0, noise=1.0, seed=3)
    fitting = as_experiment(make_readings(scenario), True)
    hypothesis, theta = with_truth(scenario, ())
    noise = Noise(wrench=(0.003, 0.006, 1.5e-4))
    w = evaluate(hypothesis, theta, fitting, noise).result.whitened
    np.testing.assert_allclose(np.sqrt(np.nanmean(w**2, axis=(0, 1))), 1.0, atol=0.06)
    imu = w[..., :3]
    np.testing.assert_allclose(np.nanmean(imu[1:] * imu[:-1], axis=(0, 1)), 0.0, atol=0.06)


@pytest.mark.parametrize("name", SENSOR_FIELDS)
def test_the_filter_undoes_what_an_instrument_does(name: str) -> None:
    """Likeliest is its true value: not none, and not the opposite one."""
    scenario = small("sensor", list(SENSOR_FIELDS).index(name), noise=1.0)
    read = as_experiment(make_readings(scenario), scenario.encoder)
    hypothesis, theta = with_truth(scenario, scenario.names)
    opposite = 2.0 if name == "camera_latency" else -1.0  # an image cannot be of the future
    likelihoods = []
    for share in (1.0, 0.0, opposite):
        moved = theta.copy()
        moved[-1] *= share
        likelihoods.append(evaluate(hypothesis, moved, read, Noise()).log_likelihood.sum())
    assert likelihoods[0] > max(likelihoods[1:]) + 5.0


def test_noise_scales_with_the_scenario_and_a_hundredth_of_the_frames_is_lost() -> None:
    read = SensorModels(60001, 2, 2.0, SensorErrors(), np.random.default_rng(0))
    zero = np.zeros(2)
    gyro, accel = (
        np.array(v)
        for v in zip(*(read.imu(k, zero, zero, zero) for k in range(20000)), strict=True)
    )
    np.testing.assert_allclose(gyro.std(axis=0), 2.0 * 0.006, rtol=0.03)
    np.testing.assert_allclose(accel.std(axis=0), 2.0 * 0.05, rtol=0.03)
    np.testing.assert_allclose(read.encoder(np.zeros((60001, 2))).std(), 2.0 * 0.15, rtol=0.03)
    np.testing.assert_allclose([len(t) for t in read.stamps], 0.99 * 600.0 * 30.0, rtol=0.005)
    seen = read.poses(0, slice(None), np.zeros((60001, 3)))
    np.testing.assert_allclose(seen.std(axis=0), [0.004, 0.004, 0.024], rtol=0.05)
    periods = np.diff(read.stamps[0])
    assert periods.min() >= 0.0
    assert np.median(periods) == pytest.approx(1 / 30, abs=2e-4)


class Tram:
    """A plant that moves on a line at 0.1 m/s and turns at 0.3 rad/s, its rotor ever faster."""

    def reset(self, poses: np.ndarray) -> None:
        self.k, self.start = 0, np.array(poses)

    def step(self, commands: np.ndarray) -> Inertial:
        self.k += 1
        return Inertial(*(np.full(len(self.start), v) for v in (0.3, 0.02, -0.01)))

    @property
    def pose(self) -> np.ndarray:
        return self.start + 0.01 * self.k * np.array([0.1, 0.0, 0.3])

    @property
    def rotor_speed(self) -> np.ndarray:
        return np.full(len(self.start), 0.5 * self.k)


class Listener:
    """Commands its grid point's number and writes down what it sees."""

    def __init__(self) -> None:
        self.seen: list[tuple[int, int, float]] = []
        self.poses: dict[int, list[Sequence[float]]] = {0: [], 1: []}

    def command(self, k: int) -> tuple[np.ndarray, np.ndarray]:
        return np.full((2, 2), float(k)), np.zeros(2)

    def observe(
        self, k: int, gyro: np.ndarray, accel: np.ndarray, poses: Sequence[Sequence[tuple]]
    ) -> None:
        for m, arrived in enumerate(poses):
            self.seen += [(k, m, stamp) for stamp, *_ in arrived]
            self.poses[m] += [pose for _, *pose in arrived]


def test_a_driver_sees_an_image_when_it_has_arrived_and_the_recording_has_the_same() -> None:
    quiet = SensorModels(
        400,
        2,
        0.0,
        SensorErrors(latency=0.05, scale=1.1, heading_offset=0.2),
        np.random.default_rng(1),
    )
    driver = Listener()
    readings = swim(Tram(), np.array([[0.0, 0.0, 0.0], [1.0, 2.0, 3.0]]), driver, quiet, 400)
    for k, _, stamp in driver.seen:
        assert 0.01 * k < stamp + CAMERA_LATENCY + 1e-9
        assert stamp + CAMERA_LATENCY <= 0.01 * (k + 1) + 1e-9
    for m in range(2):
        count = len(driver.poses[m])
        assert count == (readings.stamps[m] <= 4.0 - CAMERA_LATENCY).sum()
        np.testing.assert_allclose(driver.poses[m], readings.poses[m][:count], atol=1e-12)
        taken = np.maximum(readings.stamps[m] - 0.05, 0.0)
        expected = readings.truth[0, m] + taken[:, None] * [0.1, 0.0, 0.3]
        expected = expected * [1.1, 1.1, 1.0] + [0.0, 0.0, 0.2]
        np.testing.assert_allclose(readings.poses[m], expected, atol=1e-12)
    assert np.array_equal(readings.commands[:, 0, 0], np.arange(400.0))
    assert np.array_equal(
        readings.encoder[:, 1], 0.5 * np.arange(400)
    )  # at the grid point, not a step later
    assert np.ptp(readings.gyro, axis=0) == pytest.approx(0.0, abs=1e-15)  # the truth and a bias
    assert np.abs(readings.gyro - 0.3).max() < 0.02
    assert np.abs(readings.accel - [0.02, -0.01]).max() < 0.15
