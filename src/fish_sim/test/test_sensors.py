# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Sensor effects against their one-line meaning, noise against its stated size."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from fish_sim.ops import NUMPY
from fish_sim.sensors import SENSOR_EFFECTS
from fish_sim.sensors.distortion import SensorDistortion
from fish_sim.sensors.onboard import Battery, Encoder, Imu
from fish_sim.sensors.overhead_camera import OverheadCamera
from fish_sim.sensors.settings import SensorSettings
from fish_sim.simulation_config import SimulatorConfig

VOCABULARY = (
    "camera_latency",
    "camera_heading_offset",
    "camera_marker",
    "camera_scale",
    "gyro_scale",
    "imu_misalignment",
    "imu_latency",
)
NONE = SensorDistortion({})


def random():
    return np.random.default_rng(5)


def film(settings, seconds=200.0, enabled=None):
    """Samples of a fish that swims with 0.2 m/s and 0.5 rad/s along x."""
    camera = OverheadCamera(settings, SensorDistortion(enabled or {}), random())
    return [
        sample
        for k in range(round(100 * seconds))
        for sample in camera.update(0.01 * k, 0.002 * k, -0.3, 0.005 * k)
    ]


def test_the_table_holds_the_vocabulary():
    assert tuple(SENSOR_EFFECTS) == VOCABULARY


@pytest.mark.parametrize("name", VOCABULARY)
def test_description_is_complete_and_zero_strength_is_the_truth(name):
    effect = SENSOR_EFFECTS[name]
    assert effect.name == name
    assert effect.kind == "sensor"
    assert effect.equation
    assert effect.source
    assert set(effect.strength) == {
        k for k, p in effect.parameters.items() if p.typical is not None
    }
    p = SimpleNamespace(**{k: q.value for k, q in effect.parameters.items()})
    assert effect.pose_delay(p) == 0.0
    assert effect.pose(p, 0.4, -0.2, 1.0, NUMPY) == (0.4, -0.2, 1.0)
    np.testing.assert_allclose(effect.imu(p, 0.3, 0.1, 0.7, NUMPY), (0.3, 0.1, 0.7), atol=1e-16)


def test_camera_effects_are_idle_unless_the_camera_gives_poses():
    image = SimulatorConfig(robot_file="blue.yaml").idle_sensors(VOCABULARY)
    assert image == (
        "sensors.camera_latency, sensors.camera_heading_offset, sensors.camera_marker, sensors.camera_scale of blue.yaml: "
        "without effect on the camera node's pictures (camera:=image); with camera:=pose they act, on camera/pose"
    )
    assert SimulatorConfig(camera="pose").idle_sensors(VOCABULARY) == ""
    assert SimulatorConfig().idle_sensors(("gyro_scale", "imu_misalignment")) == ""


def test_each_sensor_effect_does_what_its_name_says():
    enabled = {
        "camera_heading_offset": {"offset": 0.06},
        "camera_scale": {"factor": 1.05},
        "gyro_scale": {"factor": 0.9},
        "imu_misalignment": {"angle": math.pi / 2},
    }
    distortion = SensorDistortion(enabled)
    np.testing.assert_allclose(distortion.pose(0.4, -0.2, 1.0), (0.42, -0.21, 1.06))
    # the IMU turned a quarter to the left sees what is left as ahead, what is ahead as right
    np.testing.assert_allclose(distortion.imu(0.3, 0.1, 0.7), (0.1, -0.3, 0.63))
    turned = SensorDistortion({"camera_marker": {"ahead": -0.03}}).pose(0.4, -0.2, math.pi / 2)
    np.testing.assert_allclose(turned, (0.4, -0.23, math.pi / 2))
    assert SensorDistortion({"camera_latency": {"delay": 0.05}}).pose_delay() == 0.05


def test_camera_frames_jitter_are_lost_arrive_late_and_are_noisy():
    settings = SensorSettings()
    samples = film(settings)
    stamps = np.array([s.stamp for s in samples])
    assert len(samples) == pytest.approx(0.99 * 200 * 30, rel=0.01)
    gaps = np.diff(stamps)
    single = gaps[gaps < 0.05]
    assert single.mean() == pytest.approx(1 / 30, rel=1e-3)
    assert single.std() == pytest.approx(0.0008, rel=0.1)
    assert (gaps > 0.05).mean() == pytest.approx(0.01, abs=0.004)
    assert all(s.arrival == pytest.approx(s.stamp + settings.camera_latency) for s in samples)
    truth = np.column_stack([0.2 * stamps, np.full(len(stamps), -0.3), 0.5 * stamps])
    noise = np.array([(s.x, s.y, s.heading) for s in samples]) - truth
    np.testing.assert_allclose(noise.std(axis=0), (0.002, 0.002, 0.012), rtol=0.1)
    assert (abs(noise.mean(axis=0)) < (2e-4, 2e-4, 1e-3)).all()
    assert abs(np.corrcoef(noise.T) - np.eye(3)).max() < 0.06  # three errors, not one


def test_camera_samples_are_handed_out_only_after_they_arrived():
    camera = OverheadCamera(SensorSettings(camera_loss=0.0), NONE, random())
    for k in range(100):
        for sample in camera.update(0.01 * k, 0.0, 0.0, 0.0):
            assert 0.01 * k - 0.011 < sample.arrival <= 0.01 * k + 1e-9


def test_camera_latency_shows_the_past():
    quiet = SensorSettings(camera_position_noise=0.0, camera_heading_noise=0.0, camera_loss=0.0)
    late = film(quiet, 5.0, {"camera_latency": {"delay": 0.05}})[5:]
    np.testing.assert_allclose(
        [s.x for s in late], [0.2 * (s.stamp - 0.05) for s in late], atol=1e-9
    )


def test_imu_has_white_noise_and_constant_bias():
    settings = SensorSettings()
    imu = Imu(settings, random())
    samples = [imu.measure((0.5, -0.2), 0.3, 1.0, 0.01) for _ in range(4000)]
    gyro = np.array([s.angular_velocity for s in samples]) - imu.gyro_bias
    force = np.array([s.specific_force for s in samples]) - imu.accelerometer_bias
    np.testing.assert_allclose(gyro.mean(0), [0, 0, 0.3], atol=5e-4)
    np.testing.assert_allclose(gyro.std(0), 0.006, rtol=0.1)
    np.testing.assert_allclose(force.mean(0), [0.5, -0.2, 9.81], atol=5e-3)
    np.testing.assert_allclose(force.std(0), 0.05, rtol=0.1)


def test_yaw_turns_with_the_head_and_drifts_as_a_random_walk():
    imu = Imu(SensorSettings(orientation_noise=0.0, orientation_drift=0.001), random())
    yaw = np.array([imu.measure((0.0, 0.0), 0.0, 0.05 * k, 0.25).yaw for k in range(4000)])
    steps = np.diff(yaw) - 0.05
    assert steps.std() == pytest.approx(0.001 * 0.5, rel=0.05)
    assert abs(steps.mean()) < 5e-5
    still = Imu(SensorSettings(orientation_noise=0.003, orientation_drift=0.0), random())
    yaw = np.array([still.measure((0.0, 0.0), 0.0, 0.0, 0.01).yaw for _ in range(4000)])
    assert yaw.std() == pytest.approx(0.003, rel=0.05)


def test_yaw_starts_at_an_unknown_angle_and_biases_differ_between_robots():
    robots = [Imu(SensorSettings(), np.random.default_rng(seed)) for seed in range(400)]
    yaw = np.array([imu.measure((0.0, 0.0), 0.0, 0.0, 0.01).yaw for imu in robots])
    assert (
        np.histogram(yaw, bins=4, range=(-math.pi, math.pi))[0].min() > 60
    )  # a quarter of 400 each
    for biases, std in (
        ([i.gyro_bias for i in robots], 0.01),
        ([i.accelerometer_bias for i in robots], 0.05),
    ):
        np.testing.assert_allclose(np.std(biases, axis=0), std, rtol=0.15)
        np.testing.assert_allclose(np.mean(biases, axis=0), 0.0, atol=0.2 * std)


def test_encoder_noise_has_its_stated_size():
    encoder = Encoder(SensorSettings(), random())
    measured = np.array([encoder.measure(3.0, 50.0) for _ in range(4000)])
    np.testing.assert_allclose(measured.mean(0), [3.0, 50.0], rtol=1e-3)
    np.testing.assert_allclose(measured.std(0), [0.002, 0.2], rtol=0.1)


def test_battery_sags_under_load_and_runs_down():
    battery = Battery(SensorSettings(battery_noise=0.0), random())
    idle = battery.measure()
    for _ in range(500):
        battery.draw(12.4, 0.01)
    loaded = battery.measure()
    # 2 A more through 0.08 ohm; 5 s of 2.6 A out of 1.3 A h on a slope of 2 V
    assert idle - loaded == pytest.approx(2 * 0.08 + 2.0 * 5 * 2.6 / (3600 * 1.3), abs=2e-3)
    for _ in range(500):
        battery.draw(0.0, 0.01)
    assert loaded < battery.measure() < idle


@pytest.mark.parametrize("power", [12.4, -12.4])
def test_battery_voltage_follows_the_load_in_a_second_and_braking_costs_as_much(power):
    battery = Battery(SensorSettings(battery_noise=0.0), random())
    idle = battery.measure()
    for _ in range(100):
        battery.draw(power, 0.01)
    # of 2 A through 0.08 ohm; the charge taken meanwhile lowers it by 1 mV more
    assert idle - battery.measure() == pytest.approx(2 * 0.08 * (1 - math.exp(-1.0)), abs=4e-3)
    battery.draw(power, 1e6)
    assert battery.measure() == 0.0


def test_the_same_seed_gives_the_same_film():
    assert film(SensorSettings(), 2.0) == film(SensorSettings(), 2.0)


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("gyro_noise", -0.1),
        ("camera_rate", 0.0),
        ("camera_loss", 1.5),
        ("camera_jitter", 0.02),
        ("gyro_bias", math.nan),
    ],
)
def test_impossible_settings_name_field_value_and_range(field, value):
    with pytest.raises(ValueError, match=rf"{field} = {value}: expected"):
        SensorSettings(**{field: value})
