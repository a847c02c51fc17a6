# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Timing of a replay, and what its configuration refuses."""

from dataclasses import asdict
from datetime import datetime
from pathlib import Path

import pytest
import yaml

from fish_bag import RecordingError
from fish_bag import sample_recordings as samples
from fish_bag.bag_metadata import Qos, parse_qos
from fish_bag.playback import Playback, PlaybackClock, ReplayerConfig
from fish_bag.recorder_config import RecorderConfig, common_qos, is_selected
from fish_bag.sample_recordings import write_rosbag1

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
