# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""One axis from several machines, simulation time included."""

import numpy as np
import pytest

from fish_bag import read_trial
from fish_bag import sample_recordings as samples
from fish_bag.trial import BAD_STAMP

ROBOT_TOPICS = (
    "joint_command",
    "joint_states",
    "imu/data",
    "odometry/filtered",
    "control/target",
    "tracking/error",
    "battery_state",
)


def moved(messages, topics, offset_s, drift=0.0):
    """The stamps of some topics on another clock: stamp -> stamp + offset + drift (stamp - start)."""
    for topic in topics:

        def change(i, t, m):
            stamp = m.header.stamp.sec * 10**9 + m.header.stamp.nanosec
            return t, samples.shift_stamp(m, offset_s + drift * (stamp - samples.START_NS) * 1e-9)

        messages = samples.changed(messages, f"/fish/{topic}", change)
    return messages


def test_same_clock_is_left_alone(tmp_path):
    trial = read_trial(samples.robot_recording(tmp_path / "a"))
    clocks = {clock.clock: clock for clock in trial.clocks}
    assert not clocks["robot"].applied
    assert not clocks["camera"].applied
    assert clocks["robot"].offset_s == pytest.approx(0.0, abs=1e-6)
    assert clocks["camera"].offset_s == pytest.approx(0.025, abs=1e-6)


@pytest.mark.parametrize(("offset", "drift"), [(-2.3e6, 0.0), (0.4, 0.0), (-86400.0, 3e-4)])
def test_robot_with_another_clock(tmp_path, offset, drift):
    """All streams agree again, on the robot's time; arrivals too."""
    messages = moved(samples.robot_messages(10.0), ROBOT_TOPICS, offset, drift)
    trial = read_trial(samples.write_mcap(tmp_path / "a", messages))
    assert trial.axis == "robot"
    assert [p.kind for p in trial.problems if p.kind == "clock"] == ["clock"]
    robot = trial.clocks[0]
    assert robot.applied
    assert robot.drift_ppm == pytest.approx(-drift * 1e6 / (1 + drift), abs=1)
    t = np.arange(0, 10, 0.01)
    np.testing.assert_allclose(trial.commands.t - trial.commands.t[0], t * (1 + drift), atol=1e-6)
    camera = np.arange(0.005, 10, 1 / 30) * (1 + drift)
    np.testing.assert_allclose(trial.camera.t - trial.commands.t[0], camera, atol=1e-4)
    np.testing.assert_allclose(trial.imu.t_arrival - trial.imu.t, 0.002, atol=1e-4)
    assert np.all(np.abs(trial.commands.t[0]) < 1e-3)


@pytest.mark.parametrize(("ahead", "axis"), [(0.0005, "recorder"), (0.002, "robot")])
def test_a_stamp_a_little_after_its_arrival_is_the_same_clock_s(tmp_path, ahead, axis):
    """Rounding and time synchronisation are good to a millisecond."""
    messages = moved(samples.robot_messages(1.0), ROBOT_TOPICS, ahead)
    assert read_trial(samples.write_mcap(tmp_path / "a", messages)).axis == axis


def test_camera_computer_with_another_clock(tmp_path):
    messages = moved(samples.robot_messages(5.0), ("camera/pose", "camera/tail"), 77.0)
    trial = read_trial(samples.write_mcap(tmp_path / "a", messages))
    assert trial.axis == "recorder"
    shortest = 0.025  # latency that cannot be told from offset
    np.testing.assert_allclose(trial.camera.t, np.arange(0.005, 5, 1 / 30) + shortest, atol=1e-6)


def test_a_simulation_has_one_clock_however_unsteady(tmp_path):
    """Simulated time that waits for a busy computer: the camera's stamps are no other clock's that drifts in its own way."""
    rng = np.random.default_rng(1)
    messages = []
    for arrival_ns, topic, message in samples.robot_messages(10.0):
        t = (arrival_ns - samples.START_NS) * 1e-9
        wall = t + 0.2 * t**1.5 + rng.exponential(0.0005)
        messages.append((samples.START_NS + round(1e9 * wall), topic, message))
    truth = [
        (
            a,
            "/fish/sim/odometry",
            samples.build.odometry(samples.ns(0.01 * i), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)),
        )
        for i, a in enumerate(
            np.linspace(messages[0][0], messages[-1][0], 1000).astype(int).tolist()
        )
    ]
    trial = read_trial(
        samples.write_mcap(tmp_path / "a", sorted(messages + truth, key=lambda m: m[0]))
    )
    assert [clock.clock for clock in trial.clocks] == ["robot"]
    np.testing.assert_allclose(
        trial.camera.t - trial.imu.t[0], np.arange(0.005, 10, 1 / 30), atol=1e-6
    )


def test_a_simulation_that_stands_still_for_long_has_no_wrong_stamps_but_those_that_are(tmp_path):
    """Time that waited 40 s for a busy computer within 10 s of simulation: far off every line."""
    messages, truth = [], []
    for arrival_ns, topic, message in samples.robot_messages(10.0):
        late = 40 * 10**9 if arrival_ns - samples.START_NS > 7 * 10**9 else 0
        messages.append((arrival_ns + late, topic, message))
    messages = samples.changed(
        messages,
        "/fish/imu/data",
        lambda i, t, m: (t, samples.shift_stamp(m, -30.0 if i == 500 else 0.0)),
    )
    truth = [
        (
            a,
            "/fish/sim/odometry",
            samples.build.odometry(samples.ns(0.01 * i), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)),
        )
        for i, a in enumerate(a for a, topic, _ in messages if topic == "/fish/joint_command")
    ]
    trial = read_trial(
        samples.write_mcap(tmp_path / "a", sorted(messages + truth, key=lambda m: m[0]))
    )
    wrong = {
        name: np.flatnonzero(stream.flags & BAD_STAMP).tolist()
        for name, stream in trial.streams.items()
    }
    assert wrong.pop("imu") == [500]
    assert {"commands", "camera", "truth"} <= wrong.keys()
    assert not any(wrong.values())


@pytest.mark.parametrize("factor", [0.5, 3.0])
def test_simulation_time_against_wall_time(tmp_path, factor):
    """A simulation that runs at another speed than the wall clock is read in simulation time."""
    rng = np.random.default_rng(0)
    messages = []
    for arrival_ns, topic, message in samples.robot_messages(10.0):
        wall = (arrival_ns - samples.START_NS) / factor + rng.exponential(3e5)
        if hasattr(message, "header"):
            message = samples.shift_stamp(message, -samples.START_NS * 1e-9)
        messages.append((samples.START_NS + round(wall), topic, message))
    trial = read_trial(samples.write_mcap(tmp_path / "a", sorted(messages, key=lambda m: m[0])))
    assert trial.axis == "robot"
    np.testing.assert_allclose(np.diff(trial.commands.t), 0.01, atol=1e-6)
    np.testing.assert_allclose(np.diff(trial.camera.t), 1 / 30, atol=1e-4)
    assert trial.duration == pytest.approx(10.0, rel=0.01)
    assert abs(trial.origin_ns) < 1e8
    gains = trial.gains.t - trial.gains.t[0]
    np.testing.assert_allclose(gains, np.arange(0, 10, 0.02), atol=0.02)
