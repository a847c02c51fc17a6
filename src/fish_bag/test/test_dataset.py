# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Data sets: many recordings, their clocks and time axes, and their playback."""

import re
import shutil
import signal
from dataclasses import asdict
from datetime import datetime
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import yaml

from fish_bag import RecordingError, read_dataset, read_trial
from fish_bag import sample_recordings as samples
from fish_bag.bag_metadata import Qos, parse_qos
from fish_bag.dataset import check_set
from fish_bag.playback import Playback, PlaybackClock, ReplayerConfig
from fish_bag.recorder_config import RecorderConfig, common_qos, is_selected
from fish_bag.recording_files import files_under
from fish_bag.recover import recover
from fish_bag.sample_recordings import write_rosbag1
from fish_bag.time_axis import estimate_clock
from fish_bag.trial import BAD_STAMP
from fish_report import robofish as command


def kinds(data):
    return [problem.kind for problem in data.problems]


def test_folder_of_trials(tmp_path):
    for name in ("trial_02", "trial_00", "trial_01"):
        samples.robot_recording(tmp_path / name, duration=0.3)
    (tmp_path / "notes.txt").write_text("not a trial")
    data = read_dataset(tmp_path)
    assert [trial.name for trial in data] == ["trial_00", "trial_01", "trial_02"]
    assert data.problems == ()
    assert data["trial_01"].path == tmp_path / "trial_01"
    with pytest.raises(KeyError, match="known: trial_00, trial_01"):
        data["trial_09"]


def test_one_trial_is_said(tmp_path):
    data = read_dataset(samples.robot_recording(tmp_path / "only", duration=0.3))
    assert (len(data), kinds(data)) == (1, ["one_trial"])


def test_unreadable_trial_is_left_out_and_said(tmp_path):
    for name in ("a", "b", "c"):
        samples.robot_recording(tmp_path / name, duration=0.3)
    file = tmp_path / "b" / "b.mcap"
    file.write_bytes(file.read_bytes()[:3000])
    data = read_dataset(tmp_path)
    assert [trial.name for trial in data] == ["a", "c"]
    assert kinds(data) == ["unreadable_trial"]
    assert "b left out" in data.problems[0].text
    assert "recover" in data.problems[0].text


@pytest.mark.parametrize("folder", ["empty", "missing"])
def test_nothing_to_read(tmp_path, folder):
    (tmp_path / "empty").mkdir()
    with pytest.raises(RecordingError, match=r"no recording|does not exist"):
        read_dataset(tmp_path / folder)


def test_a_folder_of_bare_files_is_a_folder_of_trials(tmp_path):
    for name in ("trial_0", "trial_1"):
        made = samples.robot_recording(tmp_path / name, duration=0.3)
        (made / f"{name}.mcap").rename(tmp_path / f"{name}.mcap")
        shutil.rmtree(made)
    assert [trial.name for trial in read_dataset(tmp_path)] == ["trial_0", "trial_1"]
    with pytest.raises(RecordingError, match=r"2 storage files.*give one of the recordings in it"):
        read_trial(tmp_path)
    with pytest.raises(RecordingError, match=r"2 storage files.*give one of the recordings in it"):
        recover(tmp_path, tmp_path / "mended")


def test_parts_of_a_split_recording_are_one_recording(tmp_path):
    messages, folder = samples.robot_messages(0.4), tmp_path / "swim"
    folder.mkdir()
    for k, half in enumerate((messages[: len(messages) // 2], messages[len(messages) // 2 :])):
        made = samples.write_mcap(tmp_path / f"half_{k}", half)
        (made / f"half_{k}.mcap").rename(folder / f"swim_{k}.mcap")
    (trial,) = read_dataset(folder)
    assert sum(topic.count for topic in trial.topics) == len(messages)
    assert [p.text for p in trial.problems if p.kind == "storage"] == [
        "no metadata.yaml; swim_0.mcap, swim_1.mcap read in this order"
    ]
    assert recover(folder, tmp_path / "mended").count == len(messages)


def test_a_file_and_a_folder_of_one_name_are_told_apart(tmp_path):
    made = samples.robot_recording(tmp_path / "a", duration=0.3)
    shutil.copy(made / "a.mcap", tmp_path / "a.mcap")
    assert [trial.name for trial in read_dataset(tmp_path)] == ["a", "a.mcap"]


def test_the_files_of_recordings_are_told_from_those_beside_them(tmp_path):
    for path in (
        "a/metadata.yaml",
        "a/a_0.db3",
        "a/a_0.db3-wal",
        "a/notes.csv",
        "b.mcap",
        "b.html",
    ):
        (tmp_path / path).parent.mkdir(exist_ok=True)
        (tmp_path / path).touch()
    found = {str(file.relative_to(tmp_path)) for file in files_under(tmp_path)}
    assert found == {"a/metadata.yaml", "a/a_0.db3", "a/a_0.db3-wal", "b.mcap"}
    assert files_under(tmp_path / "b.mcap") == [tmp_path / "b.mcap"]


def test_the_page_of_inspect_replaces_no_file_of_a_recording(tmp_path, capsys):
    samples.robot_recording(tmp_path / "day" / "a", duration=0.3)
    for file in (tmp_path / "day" / "a").iterdir():
        before = file.read_bytes()
        assert command.main(["inspect", str(tmp_path / "day"), "--html", str(file)]) == 1
        said = " ".join(capsys.readouterr().err.split())
        assert f"{file.name} is the input" in said
        assert "choose another --html" in said
        assert file.read_bytes() == before


def test_mixed_robots(tmp_path):
    messages = samples.robot_messages(0.3)
    samples.write_mcap(tmp_path / "a", messages, {"robot": "trout"})
    samples.write_mcap(tmp_path / "b", messages, {"robot": "carp"})
    samples.write_mcap(tmp_path / "c", samples.robot_messages(0.3, namespace="/other"))
    data = read_dataset(tmp_path)
    assert kinds(data) == ["mixed_robots", "mixed_robots"]
    assert "carp: b; trout: a" in data.problems[0].text
    assert "/other: c" in data.problems[1].text


def kin(name: str, **changes) -> SimpleNamespace:
    """As much of a trial as a set is checked by."""
    tail = SimpleNamespace(names=("tail_1", "tail_2"))
    battery = SimpleNamespace(voltage=np.array([np.nan, 14.8, 14.6]))
    return SimpleNamespace(
        name=name, metadata={}, namespace="/fish", **{"tail": tail, "battery": battery} | changes
    )


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"tail": SimpleNamespace(names=("tail_1",))}, r"differ in tail segments \(1: b; 2: a\)"),
        (
            {"battery": SimpleNamespace(voltage=np.array([22.2]))},
            r"battery \(more than 4 cells: b; up to 4 cells: a\)",
        ),
    ],
)
def test_trials_of_robots_that_are_built_differently_are_no_set(changes, text):
    (problem,) = check_set([kin("a"), kin("b", **changes)])
    assert problem.kind == "mixed_robots"
    assert re.search(text, problem.text)


def test_a_set_whose_trials_know_less_of_the_robot_is_one():
    unknown = {"tail": None, "battery": SimpleNamespace(voltage=np.array([np.nan]))}
    assert list(check_set([kin("a"), kin("b", **unknown), kin("c", battery=None)])) == []


@pytest.mark.timeout(60)
def test_several_processes_read_where_sigterm_is_caught(tmp_path):
    """As in a process with a ROS node, whose handler children inherit."""
    for i in range(4):
        samples.robot_recording(tmp_path / f"trial_{i}", duration=0.2)
    before = signal.signal(signal.SIGTERM, lambda *_: None)
    try:
        assert len(read_dataset(tmp_path, processes=2)) == 4
    finally:
        signal.signal(signal.SIGTERM, before)


def test_several_processes_read_the_same(tmp_path):
    for i in range(4):
        samples.robot_recording(tmp_path / f"trial_{i}", duration=0.2 + 0.1 * i)
    one, two = read_dataset(tmp_path, processes=1), read_dataset(tmp_path, processes=2)
    for a, b in zip(one, two, strict=True):
        assert a.name == b.name
        np.testing.assert_array_equal(a.imu.gyro, b.imu.gyro)
        assert a.problems == b.problems
        assert repr(a.topics) == repr(b.topics)


EPOCH = 1_700_000_000_000_000_000


def observe(seed, offset, drift_ppm, duration=20.0, n=2000, scale=2e-3, shortest=0.8e-3):
    """Stamps and arrivals of messages whose latency is shortest + exponential(scale)."""
    rng = np.random.default_rng(seed)
    t = np.sort(rng.uniform(0, duration, n))
    latency = shortest + rng.exponential(scale, n)
    stamp = EPOCH + np.round(t * 1e9).astype(np.int64)
    error = offset + drift_ppm * 1e-6 * (t - duration / 2)
    return stamp, stamp + round(offset) * 10**9 + np.round(
        (error - round(offset) + latency) * 1e9
    ).astype(np.int64)


def test_offset_and_drift_within_their_standard_errors():
    results = []
    for seed in range(60):
        clock = estimate_clock("c", ("a",), *observe(seed, offset=3.7, drift_ppm=40.0))
        results.append(
            (
                (clock.offset_s - 3.7 - 0.8e-3) / clock.offset_std_s,
                (clock.drift_ppm - 40) / clock.drift_std_ppm,
            )
        )
    within = np.mean(np.abs(results) < 2, axis=0)
    assert np.all(within > 0.8), f"covered within two standard errors: {within}"
    assert np.mean(np.abs(results) < 4) > 0.97


def test_error_shrinks_to_microseconds():
    clock = estimate_clock("c", ("a",), *observe(1, offset=-2329263.99, drift_ppm=-15.0, n=5000))
    assert clock.offset_s == pytest.approx(-2329263.99 + 0.8e-3, abs=5e-6)
    assert clock.drift_ppm == pytest.approx(-15, abs=2)
    assert clock.drift_is_significant


def test_single_early_messages_do_not_pull_the_envelope():
    stamp, arrival = observe(2, offset=0.0, drift_ppm=0.0)
    arrival[[0, 5]] -= 15_000_000
    clock = estimate_clock("c", ("a",), stamp, arrival)
    assert clock.offset_s == pytest.approx(0.8e-3, abs=5e-5)


def test_few_messages_give_no_uncertainty():
    stamp, arrival = observe(3, offset=1.0, drift_ppm=0.0, n=4)
    clock = estimate_clock("c", ("a",), stamp, arrival)
    assert clock.offset_s == pytest.approx(np.min(arrival - stamp) * 1e-9)
    assert np.isnan(clock.offset_std_s)
    assert not clock.drift_is_significant


@pytest.mark.parametrize("drift_ppm", [0.0, 80.0, -5e5])
def test_there_and_back(drift_ppm):
    stamp, arrival = observe(4, offset=12.5, drift_ppm=drift_ppm)
    clock = estimate_clock("c", ("a",), stamp, arrival)
    recorder = EPOCH + np.round(clock.to_recorder(stamp, EPOCH) * 1e9).astype(np.int64)
    np.testing.assert_allclose(
        clock.from_recorder(recorder, EPOCH), (stamp - EPOCH) * 1e-9, atol=1e-8
    )


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


CONFIG = Path(__file__).parents[1] / "config"


def test_rate_pause_and_restart():
    clock = PlaybackClock(rate=2.0, bag_ns=1000, steady_ns=50)
    assert clock.bag_time(150) == 1200
    assert clock.wait(1400, 150) == 100
    assert clock.wait(1100, 150) == 0
    clock.set_paused(True, 150)
    assert clock.bag_time(10_000) == 1200
    clock.set_paused(False, 10_000)
    assert clock.bag_time(10_010) == 1220
    clock.restart(0, 20_000)
    assert clock.bag_time(20_005) == 10


def test_starts_paused():
    clock = PlaybackClock(1.0, 7, 0, paused=True)
    assert clock.bag_time(10**9) == 7


def test_messages_come_in_order_and_filtered(tmp_path):
    path = samples.robot_recording(tmp_path / "a", duration=0.5)
    config = ReplayerConfig(
        str(path), topics=("imu/data", "/fish/camera/*"), exclude=("camera/tail",)
    )
    playback = Playback(config, "/fish")
    for _ in range(2):  # every call starts anew
        sent = list(playback.messages())
        assert {raw.topic for raw, _, _ in sent} == {"/fish/imu/data", "/fish/camera/pose"}
        times = [t for _, t, _ in sent]
        assert times == sorted(times)
        assert len(times) == 50 + 15


@pytest.mark.parametrize(
    ("topics", "arming"),
    [
        (ReplayerConfig.topics, set()),
        (("/fish/*",), set()),
        (("*", "arming/*"), {"/fish/arming/state", "/fish/arming/disarm"}),
        (("*", "/fish/arming/state"), {"/fish/arming/state"}),
    ],
)
def test_the_arming_state_is_replayed_only_where_it_is_named(tmp_path, topics, arming):
    kind, raw = "std_msgs/msg/Float64", samples.build.number(1.0)
    with samples.McapRecording(tmp_path / "a") as recording:
        for topic in ("/fish/imu", "/fish/arming/state", "/fish/arming/disarm"):
            data = bytes(samples.typestore().serialize_cdr(raw, kind))
            recording.write(recording.add_topic(topic, kind, Qos()), 1, data)
    playback = Playback(ReplayerConfig(str(tmp_path / "a"), topics=topics), "/fish")
    assert {raw.topic for raw in playback.topics} == {"/fish/imu"} | arming


@pytest.mark.parametrize("topics", [("sonar",), ("",)])
def test_no_topic_left(tmp_path, topics):
    path = samples.robot_recording(tmp_path / "a", duration=0.1)
    with pytest.raises(RecordingError, match="it holds /fish/battery_state"):
        Playback(ReplayerConfig(str(path), topics=topics), "/fish")


@pytest.mark.parametrize("path", ["", "/nowhere/at/all"])
def test_no_recording(path):
    with pytest.raises(RecordingError, match=r"expected a rosbag2 folder|does not exist"):
        Playback(ReplayerConfig(path), "/fish")


def test_ros1_bags_are_refused(tmp_path):
    path = write_rosbag1(tmp_path / "a.bag", samples.robot_messages(0.1))
    with pytest.raises(RecordingError, match="ROS 1 bags are not replayed"):
        Playback(ReplayerConfig(str(path)), "/fish")


def test_a_damaged_recording_is_refused_with_advice(tmp_path):
    path = samples.robot_recording(tmp_path / "a")
    data = bytearray((path / "a.mcap").read_bytes())
    data[data.index(b"imu_link", len(data) // 2)] ^= 0xFF
    (path / "a.mcap").write_bytes(bytes(data))
    with pytest.raises(RecordingError, match=r"'robofish recover .*/a' saves what is left"):
        Playback(ReplayerConfig(str(path)), "/fish")


def test_a_folder_without_metadata_is_replayed(tmp_path):
    path = samples.robot_recording(tmp_path / "a", duration=0.1)
    (path / "metadata.yaml").unlink()
    playback = Playback(ReplayerConfig(str(path)), "/fish")
    assert len(list(playback.messages())) == len(samples.robot_messages(0.1))


@pytest.mark.parametrize(("apart", "rest"), [(None, 0.1), (1, 0.1), (0.15e9, 0.025), (0.3e9, 0.0)])
def test_a_loop_over_a_moment_rests_between_its_rounds(tmp_path, apart, rest):
    with samples.McapRecording(tmp_path / "a") as recording:
        kind = "std_msgs/msg/Float64"
        raw = bytes(samples.typestore().serialize_cdr(samples.build.number(1.0), kind))
        topic = recording.add_topic("/fish/a", kind)
        for time_ns in (1000, *([] if apart is None else [1000 + round(apart)])):
            recording.write(topic, time_ns, raw)
    playback = Playback(ReplayerConfig(str(tmp_path / "a"), rate=2.0, loop=True), "/fish")
    assert playback.rest_ns == pytest.approx(rest * 1e9, abs=10)


def test_quality_of_service_survives(tmp_path):
    with samples.McapRecording(tmp_path / "a") as recording:
        kind, latched = "std_msgs/msg/Float64", Qos(reliable=True, transient_local=True, depth=3)
        raw = bytes(samples.typestore().serialize_cdr(samples.build.number(1.0), kind))
        recording.write(recording.add_topic("/fish/a", kind, latched), 1, raw)
    playback = Playback(ReplayerConfig(str(tmp_path / "a")), "/fish")
    assert parse_qos(playback.topics[0].stored.qos) == latched


def test_selection():
    assert is_selected("/fish/imu/data", ["imu/data"], "/fish")
    assert is_selected("/fish/reference/path", ["reference/*"], "/fish/")
    assert is_selected("/clock", ["/clock"], "/fish")
    assert not is_selected("/clock", ["clock"], "/fish")
    assert not is_selected("/other/imu/data", ["imu/data", "*"], "/fish")
    assert not is_selected("/fish/x", ["", "/"], "/fish")


def test_common_qos_reaches_every_publisher():
    assert not common_qos([Qos(), Qos(reliable=False)]).reliable
    assert not common_qos([Qos(transient_local=True), Qos()]).transient_local
    assert common_qos([Qos(transient_local=True)]).transient_local


@pytest.mark.parametrize(
    ("name", "config"), [("recorder", RecorderConfig()), ("replayer", ReplayerConfig())]
)
def test_parameter_files_name_every_field(name, config):
    given = yaml.safe_load((CONFIG / f"{name}.yaml").read_text())["/**"]["ros__parameters"]
    assert given == {k: list(v) if isinstance(v, tuple) else v for k, v in asdict(config).items()}


@pytest.mark.parametrize(
    ("kind", "values", "text"),
    [
        (RecorderConfig, {"output": ""}, "output"),
        (RecorderConfig, {"name": "a/b"}, "name = 'a/b'"),
        (RecorderConfig, {"topics": ("",)}, "topics"),
        (RecorderConfig, {"chunk_s": 3.0}, "chunk_s = 3.0: expected 0.05 to 1 s"),
        (RecorderConfig, {"discovery_s": 0.0}, "discovery_s"),
        (ReplayerConfig, {"rate": 0.0}, "rate = 0.0: expected 0.01 to 100"),
        (ReplayerConfig, {"clock_hz": -1.0}, "clock_hz"),
        (ReplayerConfig, {"start_delay_s": -1.0}, "start_delay_s"),
    ],
)
def test_values_out_of_range(kind, values, text):
    with pytest.raises(ValueError, match=text):
        kind(**values)


def test_directory_of_a_recording():
    now = datetime(2026, 3, 4, 5, 6, 7)
    assert RecorderConfig(output="/x").directory(now) == Path("/x/fish_20260304_050607")
    assert RecorderConfig(output="/x", name="run").directory(now) == Path("/x/run")
