# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""read_trial: every storage format gives the values that were written, on one time axis."""

import numpy as np
import pytest

from fish_bag import RecordingError, TopicMap, read_trial
from fish_bag import message_build as build
from fish_bag import sample_recordings as samples
from fish_bag.sample_recordings import WRITERS
from fish_bag.topic_map import DEFAULT_RULES, TopicRule


@pytest.fixture(scope="module")
def sources(tmp_path_factory):
    """The same messages in every format."""
    folder, messages = tmp_path_factory.mktemp("formats"), samples.robot_messages()
    return {
        form: write(folder / form.replace(" ", "_"), messages) for form, write in WRITERS.items()
    }


@pytest.mark.parametrize("form", WRITERS)
def test_values_and_times(sources, form):
    trial = read_trial(sources[form])
    kinds = {"storage"} if form == "sqlite3 log" else set()  # the log and what it adds are named
    assert {p.kind for p in trial.problems if p.severity != "info"} == kinds
    assert (trial.namespace, trial.axis, trial.origin_ns) == ("/fish", "recorder", samples.START_NS)
    t = np.arange(0, 2, 0.01)
    for stream, latency in ((trial.commands, 0.0), (trial.encoder, 0.001), (trial.imu, 0.002)):
        np.testing.assert_allclose(stream.t, t, atol=2e-9)
        np.testing.assert_allclose(stream.t_arrival - stream.t, latency, atol=2e-9)
    np.testing.assert_array_equal(trial.commands.rotor_speed, samples.rotor_speed(t))
    np.testing.assert_array_equal(trial.commands.rotor_phase, samples.phase(t))
    np.testing.assert_array_equal(trial.commands.rudder, samples.rudder(t))
    np.testing.assert_array_equal(trial.encoder.angle, 0.5 * t)
    np.testing.assert_array_equal(trial.encoder.speed, samples.rotor_speed(t) - 0.5)
    np.testing.assert_array_equal(trial.imu.gyro, np.column_stack([0.1 + 0 * t, 0.2 + 0 * t, t]))
    np.testing.assert_array_equal(trial.imu.accel[:, 1], t)
    np.testing.assert_array_equal(trial.imu.orientation[0], [0, 0, 0.6, 0.8])
    tc = np.arange(0.005, 2, 1 / 30)
    np.testing.assert_allclose(trial.camera.t, tc, atol=2e-9)
    np.testing.assert_allclose(trial.camera.pose, samples.pose(tc), atol=1e-12)
    np.testing.assert_array_equal(trial.camera.covariance[0], np.diag([4e-6, 4e-6, 1.44e-4]))
    assert trial.tail.names == ("tail_1", "tail_2")
    np.testing.assert_allclose(trial.tail.angle, np.column_stack([0.1 * tc, -0.2 * tc]))
    np.testing.assert_allclose(trial.odometry.pose, samples.pose(t), atol=1e-12)
    np.testing.assert_allclose(trial.odometry.v, 0.01 * t)
    assert trial.gains.names == ("p", "i", "d", "p2", "i2", "d2")
    np.testing.assert_allclose(trial.gains.values[:, 5], np.arange(0, 2, 0.02))
    np.testing.assert_allclose(trial.target.course, 0.5)
    np.testing.assert_array_equal(trial.tracking_error.heading, 0.02)
    np.testing.assert_array_equal(trial.reference_path, [[0, 0], [1, 0.5], [1.5, 0.5]])
    assert trial.reference_speed.speed.tolist() == [0.2]
    np.testing.assert_allclose(trial.battery.voltage, [12.0, 11.9], atol=1e-6)


def test_custom_data_and_counts(sources):
    trial = read_trial(sources["own"])
    assert trial.metadata == {"robot": "test fish"}
    by_topic = {topic.topic: topic for topic in trial.topics}
    imu = by_topic["/fish/imu/data"]
    assert (imu.count, imu.role, imu.stamped) == (200, "imu", True)
    assert imu.rate_hz == pytest.approx(100, rel=1e-6)
    np.testing.assert_allclose(imu.latency_s, 0.002, atol=1e-8)
    assert by_topic["/fish/control/gains"].stamped is False


def test_a_stamp_of_zero_is_none(tmp_path):
    points = np.array([[0.0, 0.0], [1.0, 0.5]])
    messages = [
        (arrival, topic, build.path(0, "pool", points) if topic.endswith("/path") else message)
        for arrival, topic, message in samples.robot_messages()
    ]
    trial = read_trial(samples.write_mcap(tmp_path / "trial", messages))
    (topic,) = (t for t in trial.topics if t.topic.endswith("reference/path"))
    assert (topic.count, topic.stamped) == (1, False)
    assert np.isnan(topic.latency_s).all()


def test_arrival_times_by_map(sources):
    rules = dict(DEFAULT_RULES) | {"imu": TopicRule("imu/data", time="arrival")}
    trial = read_trial(sources["own"], TopicMap(rules))
    np.testing.assert_allclose(trial.imu.t, np.arange(0, 2, 0.01) + 0.002, atol=2e-9)


def test_other_names_by_map(tmp_path):
    messages = samples.robot_messages(0.5, namespace="/robots/seven")
    messages = [(t, topic.replace("imu/data", "sensors/imu"), m) for t, topic, m in messages]
    rules = dict(DEFAULT_RULES) | {"imu": TopicRule("/robots/seven/sensors/imu", frame="imu_link")}
    trial = read_trial(samples.write_mcap(tmp_path / "a", messages), TopicMap(rules))
    assert trial.namespace == "/robots/seven"
    assert len(trial.imu) == 50


@pytest.mark.parametrize(
    ("make", "text"),
    [
        (lambda p: p / "nothing", "does not exist"),
        (lambda p: _file(p / "empty.mcap", b""), "empty"),
        (lambda p: _file(p / "notes.txt", b"hello"), "not a recording"),
        (lambda p: _file(p / "junk.mcap", b"hello world" * 50), "damaged.*nothing is left"),
        (lambda p: _file(p / "junk.bag", b"hello world" * 50), "damaged.*nothing is left"),
        (lambda p: _file(p / "junk.db3", b"hello world" * 50), "damaged.*nothing is left"),
        (lambda p: samples.write_mcap(p / "none", []), "no messages"),
        (lambda p: _truncated(p), "robofish recover"),
        (lambda p: _file(p / "folder" / "metadata.yaml", b"a: ["), "no storage file"),
    ],
)
def test_unreadable_recordings_say_why(tmp_path, make, text):
    path = make(tmp_path)
    with pytest.raises(RecordingError, match=text) as error:
        read_trial(path)
    assert "Traceback" not in str(error.value)
    assert str(tmp_path) in str(error.value)


def test_foreign_recording_lists_what_it_holds(tmp_path):
    path = samples.write_mcap(tmp_path / "a", [(1, "/lidar/range", samples.build.number(1.0))])
    with pytest.raises(RecordingError, match=r"/lidar/range \(std_msgs/msg/Float64\)"):
        read_trial(path)


def test_two_robots_in_one_recording(tmp_path):
    both = samples.robot_messages(0.2, "/fish") + samples.robot_messages(0.2, "/carp")
    path = samples.write_mcap(tmp_path / "a", sorted(both, key=lambda m: m[0]))
    with pytest.raises(RecordingError, match="2 robots"):
        read_trial(path)
    assert len(read_trial(path, TopicMap(namespace="/carp")).commands) == 20


def _file(path, data):
    path.parent.mkdir(exist_ok=True)
    path.write_bytes(data)
    return path if path.name != "metadata.yaml" else path.parent


def _truncated(folder):
    path = samples.robot_recording(folder / "cut")
    file = path / "cut.mcap"
    file.write_bytes(file.read_bytes()[:50_000])
    return path
