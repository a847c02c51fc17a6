# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The simulation of a robot: its parameters, its sensors, and what a run gives."""

import math
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import yaml

from fish_sim.effects import EFFECTS
from fish_sim.effects.hull import QuadraticDrag
from fish_sim.ops import NUMPY
from fish_sim.robot import Robot, RobotError, nominal_parameters, parameter_names
from fish_sim.robot_file import load_robot, save_robot
from fish_sim.sensors import SENSOR_EFFECTS
from fish_sim.sensors.distortion import SensorDistortion
from fish_sim.sensors.onboard import Battery, Encoder, Imu
from fish_sim.sensors.overhead_camera import OverheadCamera
from fish_sim.sensors.settings import SensorSettings
from fish_sim.simulation import Simulation
from fish_sim.simulation_config import SimulationConfig, SimulatorConfig

QUIET = {
    "gyro_noise": 0.0,
    "gyro_bias": 0.0,
    "accelerometer_noise": 0.0,
    "accelerometer_bias": 0.0,
    "encoder_angle_noise": 0.0,
    "encoder_speed_noise": 0.0,
    "disturbance": 0.0,
}


def swim(simulation, periods, rudder=0.0, amplitude=9.0):
    readings = []
    for _ in range(periods):
        speed = amplitude * 4 * math.pi * math.sin(4 * math.pi * (simulation.time + 0.01))
        simulation.command(speed, rudder)
        readings.append(simulation.advance())
    return readings


def test_sensors_agree_with_the_truth_when_they_are_perfect():
    readings = swim(Simulation(Robot(), SimulationConfig(**QUIET)), 300, rudder=0.2)
    time = np.array([r.time for r in readings])
    rate = np.array([r.truth.velocity[2] for r in readings])
    gyro = np.array([r.imu.angular_velocity[2] for r in readings])
    np.testing.assert_allclose(gyro, rate)
    heading = np.array([r.truth.pose[2] for r in readings])
    np.testing.assert_allclose(np.gradient(heading, time)[5:-5], rate[5:-5], atol=0.1)
    angle, speed = np.array([r.rotor for r in readings]).T
    # the speed is linear between samples: the trapezoidal sum is exact
    np.testing.assert_allclose(np.diff(angle), 0.005 * (speed[1:] + speed[:-1]), atol=1e-9)


def test_the_accelerometer_tells_the_acceleration_at_its_stamp():
    """Against finite differences of the trajectory; the mean over the period before is 5 ms late and several times as far off."""
    readings = swim(Simulation(Robot(), SimulationConfig(**QUIET)), 400, rudder=0.2)
    heading = np.array([r.truth.pose[2] for r in readings])
    cos, sin = np.cos(heading), np.sin(heading)
    u, v = np.array([r.truth.velocity[:2] for r in readings]).T
    ahead, left = np.array([r.imu.specific_force[:2] for r in readings]).T
    velocity = np.column_stack([u * cos - v * sin, u * sin + v * cos])
    felt = np.column_stack([ahead * cos - left * sin, ahead * sin + left * cos])[2:-2]
    # of fourth order in the period: by (8 (v[k+1] - v[k-1]) - (v[k+2] - v[k-2])) / (12 dt)
    change = (8 * (velocity[3:-1] - velocity[1:-3]) - (velocity[4:] - velocity[:-4])) / 0.12
    swimming = slice(50, None)
    off, size = (np.sqrt(np.mean(a[swimming] ** 2, axis=0)) for a in (felt - change, change))
    assert (off < 0.03 * size).all()
    # and what it adds up to is the way from the first velocity to the last
    assert 0.005 * np.sum(felt[1:] + felt[:-1], axis=0) == pytest.approx(
        velocity[-3] - velocity[2], abs=2e-3
    )


def test_tail_angles_bend_left_when_negative():
    readings = swim(Simulation(Robot(), SimulationConfig(**QUIET)), 200, rudder=0.4)
    assert (
        np.mean([r.truth.tail[0] for r in readings[100:]]) < -0.2
    )  # alpha > 0 bends it to the left
    assert readings[-1].truth.pose[2] > 0.2  # and steers left


def test_stale_commands_stop_the_rotor_and_centre_the_rudder():
    simulation = Simulation(Robot(), SimulationConfig(command_timeout=0.25, stop_time=0.5))
    simulation.command(100.0, 0.4)
    followed = []
    for _ in range(100):
        followed.append((simulation.command_age, *simulation.effective_command()))
        simulation.advance()
    for age, rotor, rudder in followed:
        if age <= 0.25:
            assert (rotor, rudder) == (100.0, 0.4)
        else:
            assert rudder == 0.0
            assert rotor == pytest.approx(100 * max(0.0, 1 - (age - 0.25) / 0.5), abs=1e-9)


def test_without_any_command_the_fish_rests():
    simulation = Simulation(
        Robot(), SimulationConfig(disturbance=0.0, start_x=1.0, start_heading=0.5)
    )
    readings = [simulation.advance() for _ in range(50)]
    np.testing.assert_allclose(readings[-1].truth.pose, (1.0, 0.0, 0.5), atol=1e-12)


def test_water_disturbance_has_its_level_and_moves_the_fish():
    simulation = Simulation(Robot(), SimulationConfig(disturbance=0.01))
    pushes = []
    for _ in range(4000):
        simulation._stir_water()
        pushes.append(simulation._push.copy())
    np.testing.assert_allclose(np.std(pushes, axis=0), [0.01, 0.01, 0.0003], rtol=0.25)
    assert np.linalg.norm([simulation.advance() for _ in range(200)][-1].truth.pose) > 1e-4


def test_a_seed_gives_one_run_and_a_reset_gives_it_again():
    first, other = (Simulation(Robot(), SimulationConfig(seed=s)) for s in (3, 4))
    again = Simulation(Robot(), SimulationConfig(seed=3))
    a, b, c = (swim(s, 60)[-1] for s in (first, again, other))
    assert a.truth == b.truth
    assert a.rotor == b.rotor
    assert a.truth != c.truth
    before = first.time
    first.reset()
    assert first.time == before
    assert first.command_age == math.inf
    rerun = first.advance(), again.reset() or again.advance()
    assert rerun[0].truth == rerun[1].truth


def test_battery_is_read_once_a_second_and_the_camera_at_its_rate():
    readings = swim(Simulation(Robot(), SimulationConfig()), 500)
    assert sum(r.battery is not None for r in readings) == 5
    assert sum(len(r.camera) for r in readings) == pytest.approx(147, abs=5)


def test_an_unexplained_push_of_the_robot_file_stays_beside_the_random_one():
    robot = Robot().with_effect("disturbance", surge=0.05)
    simulation = Simulation(robot, SimulationConfig(disturbance=0.0))
    assert [simulation.advance() for _ in range(100)][-1].truth.velocity[0] > 0.02


@pytest.mark.parametrize(
    "command", [(math.nan, 0.0), (math.inf, 0.0), (2000.0, 0.0), (0.0, math.nan), (0.0, 7.0)]
)
def test_impossible_commands_are_refused_and_the_last_one_stays(command):
    simulation = Simulation(Robot(), SimulationConfig())
    simulation.command(10.0, 0.1)
    with pytest.raises(ValueError, match="expected"):
        simulation.command(*command)
    assert simulation.effective_command() == (10.0, 0.1)


def test_a_motion_that_diverges_is_reported_and_starts_again():
    simulation = Simulation(Robot(), SimulationConfig(start_x=0.5))
    simulation._state[6:12] = 1e200
    with pytest.raises(FloatingPointError, match="diverged"):
        simulation.advance()
    assert simulation.resets == 1
    assert simulation.advance().truth.pose[0] == pytest.approx(0.5, abs=1e-3)


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("start_x", 3.0),
        ("seed", -1),
        ("command_timeout", 0.0),
        ("real_time_factor", -1.0),
        ("camera", "both"),
    ],
)
def test_impossible_parameters_name_field_value_and_range(field, value):
    with pytest.raises(ValueError, match=rf"{field} = {value!r}: expected"):
        SimulatorConfig(**{field: value})


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


def test_nominal_fish_is_the_published_one():
    r = Robot().parameters
    assert r["head_mass"] + 3 * r["link_mass"] + r["fin_mass"] == pytest.approx(0.535)
    assert 3 * r["link_length"] + r["fin_length"] == pytest.approx(0.100)
    assert r["fin_added_mass_sway"] == pytest.approx(4.418 * 0.03, rel=1e-4)


@pytest.mark.parametrize("links", [1, 3, 5])
def test_tail_keeps_length_mass_and_total_stiffness_whatever_the_number_of_links(links):
    r = Robot(links=links).parameters
    assert links * r["link_length"] == pytest.approx(0.07)
    assert links * r["link_mass"] == pytest.approx(0.05)
    assert r["tail_stiffness"] / links == pytest.approx(0.1 / 3)


def test_an_effect_or_a_sensor_error_can_be_taken_away_again():
    robot = Robot().with_effect("tip_slip", mobility=0.2)
    more = robot.with_effect("current", x=0.1, y=0.0).with_effect("gyro_scale", factor=1.1)
    assert more.without_effect("current").without_effect("gyro_scale") == robot
    assert robot.without_effect("current") == robot


def test_a_file_gives_back_the_robot_with_effects_and_sensors(tmp_path):
    robot = Robot(links=2, name="blue").with_parameters(head_drag_surge=0.25)
    robot = robot.with_effect("tip_slip", mobility=0.2).with_effect("camera_latency", delay=0.05)
    save_robot(
        robot, tmp_path / "model.yaml", std={"head_drag_surge": 0.01, "tip_slip.mobility": 0.02}
    )
    again = load_robot(tmp_path / "model.yaml")
    assert again == robot
    assert again.digest() == robot.digest()
    content = yaml.safe_load((tmp_path / "model.yaml").read_text())
    assert content["parameters"]["head_drag_surge"]["std"] == 0.01
    assert content["effects"]["tip_slip"]["mobility"] == {
        "value": 0.2,
        "unit": "m/(N s)",
        "std": 0.02,
        "source": "identified or set by the user",
    }
    assert all(row["unit"] and row["source"] for row in content["parameters"].values())


def test_an_unknown_standard_error_is_left_out_of_the_file(tmp_path):
    unknown = {"head_mass": math.nan, "link_mass": math.inf, "head_drag_yaw": 1e-4}
    save_robot(Robot(), tmp_path / "model.yaml", std=unknown)
    assert load_robot(tmp_path / "model.yaml") == Robot()
    content = yaml.safe_load((tmp_path / "model.yaml").read_text())
    assert [n for n, row in content["parameters"].items() if "std" in row] == ["head_drag_yaw"]


def test_digest_tells_robots_apart_by_motion_and_not_by_name():
    robot = Robot()
    assert Robot(name="other").digest() == robot.digest()
    assert robot.with_parameters(head_mass=0.5).digest() != robot.digest()
    assert robot.with_effect("current").digest() != robot.digest()


def test_vector_follows_the_parameter_names():
    robot = (
        Robot().with_effect("rudder_lag", time_constant=0.1).with_effect("tip_slip", mobility=0.2)
    )
    names = parameter_names(robot.structure)
    assert dict(zip(names, robot.vector(), strict=True))["tip_slip.mobility"] == 0.2
    own = EFFECTS["tip_slip"], EFFECTS["rudder_lag"]
    assert robot.structure == (3, own)  # table order, not the order of adding


def test_a_table_of_ones_own_adds_an_effect_to_one_robot_alone():
    class Mine(QuadraticDrag):
        name = "mine"

    robot = Robot(table={**EFFECTS, "mine": Mine}).with_effect("mine", surge=0.6)
    assert robot.structure == (3, (Mine,))
    assert "mine.surge" in parameter_names(robot.structure)
    with pytest.raises(RobotError, match="unknown effect 'mine'"):
        Robot().with_effect("mine")


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Robot(links=0), ["links", "0", "1 to 12"]),
        (lambda: Robot(links=2.5), ["links", "2.5"]),
        (lambda: Robot(parameters={"head_mass": -1.0}), ["parameters.head_mass", "-1.0", "kg"]),
        (lambda: Robot(parameters={"head_mass": math.nan}), ["parameters.head_mass", "nan"]),
        (lambda: Robot(parameters={"head_mass": True}), ["parameters.head_mass", "True"]),
        (
            lambda: Robot(parameters={"head_mas": 1.0}),
            ["parameters.head_mas", "unknown", "head_mass"],
        ),
        (lambda: Robot(effects={"darg": {}}), ["darg", "known", "quadratic_drag"]),
        (lambda: Robot(effects={"current": {"z": 1.0}}), ["effects.current.z", "known: x, y"]),
        (lambda: Robot(effects={"current": {"x": math.inf}}), ["effects.current.x", "inf"]),
        (lambda: Robot(sensors={"current": {}}), ["sensors", "current", "camera_latency"]),
    ],
)
def test_impossible_robots_are_refused_with_name_and_value(make, words):
    with pytest.raises(RobotError) as error:
        make()
    assert all(word in str(error.value) for word in words), error.value


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[1, 2", ["cannot be read as YAML"]),
        ("format: 2020-13-45", ["cannot be read as YAML"]),
        ("[" * 20_000, ["nested too deeply"]),
        ("format: 1\nname: [a]", ["name: got ['a']", "a word"]),
        (
            "format: 1\neffects:\n  current: {x: 0.1}\n  current: {x: 0.2}",
            ["current is given twice in the table of line 3"],
        ),
        ("3", ["int", "table"]),
        ("format: 2", ["format", "2", "expected 1"]),
        ("format: 1\ncolour: blue", ["colour", "unknown field"]),
        ("format: 1\n7: 8\ncolour: blue\nnull: 9", ["7: unknown field"]),
        ("format: 1\nlinks: many", ["links", "many"]),
        ("format: 1\nparameters: [1]", ["parameters", "[1]"]),
        ("format: 1\nparameters: {head_mass: heavy}", ["parameters.head_mass", "heavy"]),
        ("format: 1\nparameters: {head_inertia: 1e-3}", ["head_inertia", "1.0e-3"]),
        (
            f"format: 1\nparameters: {{head_mass: 1{'0' * 400}}}",
            ["parameters.head_mass", "beyond every float"],
        ),
        (
            f"format: 1\nsensors: {{gyro_scale: {{factor: 0x{'f' * 9999}}}}}",
            ["gyro_scale.factor", "[0.5, 2] 1"],
        ),
        ("format: 1\nparameters: {head_mass: {unit: kg}}", ["parameters.head_mass", "value"]),
        (
            "format: 1\nparameters: {head_mass: {value: 465, unit: g}}",
            ["head_mass.unit", "'g'", "'kg'"],
        ),
        (
            "format: 1\nparameters: {head_mass: {value: 465, units: g}}",
            ["parameters.head_mass.units: unknown field; known: value, unit, std, source"],
        ),
        ("format: 1\nparameters: {head_mass: {value: 1, 7: 2}}", ["parameters.head_mass.7"]),
        *(
            (
                f"format: 1\nparameters: {{head_mass: {{value: 0.5, std: {std}}}}}",
                ["parameters.head_mass.std: got", "expected a number in [0, inf] kg"],
            )
            for std in ("-.inf", "-0.1", "true", "1e-3", f"1{'0' * 400}")
        ),
        (
            "format: 1\neffects: {tip_slip: {mobility: {value: 1, knowledge: measured}}}",
            ["effects.tip_slip.mobility.knowledge: unknown field; known: value, unit, std, source"],
        ),
        *(
            (
                f"format: 1\neffects: {{quadratic_drag: {nothing}}}",
                ["effects.quadratic_drag: got no parameter; expected at least one of surge, "],
            )
            for nothing in ("", "{}", "null")
        ),
        (
            "format: 1\nsensors: {camera_latency: }",
            ["sensors.camera_latency: got no parameter; expected at least one of delay"],
        ),
        ("format: 1\neffects: {quadratic_drag: []}", ["effects.quadratic_drag: got []"]),
        ("format: 1\neffects: [current]", ["effects", "current", "table"]),
        ("format: 1\neffects: {darg: {}}", ["darg", "known"]),
        (
            "format: 1\neffects: {tip_slip: {mobility: {value: 1, unit: m}}}",
            ["tip_slip.mobility.unit", "'m'"],
        ),
    ],
)
def test_broken_files_name_file_field_and_expectation(tmp_path, text, words):
    path = tmp_path / "robot.yaml"
    path.write_text(text)
    with pytest.raises(RobotError) as error:
        load_robot(path)
    assert all(word in str(error.value) for word in ["robot.yaml", *words]), error.value


def test_a_missing_file_and_a_picture_are_refused_in_one_line(tmp_path):
    with pytest.raises(RobotError, match=r"nowhere.yaml"):
        load_robot(tmp_path / "nowhere.yaml")
    (tmp_path / "robot.yaml").write_bytes(b"\xff\xd8\xff\xe0 jpeg")
    with pytest.raises(RobotError, match="cannot be read"):
        load_robot(tmp_path / "robot.yaml")


def test_every_effect_and_sensor_effect_can_be_enabled_by_name_alone():
    for name in (*EFFECTS, *SENSOR_EFFECTS):
        robot = Robot().with_effect(name)
        assert name in (robot.effects if name in EFFECTS else robot.sensors)


def test_shipped_robot_file_is_the_nominal_robot():
    shipped = load_robot(Path(__file__).parent.parent / "config" / "robot.yaml")
    assert shipped == Robot(name="nominal fish")
    assert list(shipped.parameters) == list(nominal_parameters())


@pytest.mark.parametrize("std", [".nan", ".inf", "null"])
def test_a_standard_error_that_nobody_knows_is_none(tmp_path, std):
    file = tmp_path / "robot.yaml"
    file.write_text(f"format: 1\nparameters: {{head_mass: {{value: 0.5, std: {std}}}}}")
    assert load_robot(file).parameters["head_mass"] == 0.5
