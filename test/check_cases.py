# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Recordings, drawings and camera files of a folder of cases against their right answers; the folder is no part of the project.

    python test/check_cases.py FOLDER

A case is a folder in FOLDER whose name stands in CASES. Exit status: 0 all right, 1 one is wrong, 2 the folder is absent.
"""

from __future__ import annotations

import math
import os
import re
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
from sensor_msgs.msg import Imu

from fish_bag import RecordingError, Trial, read_trial
from fish_bag.playback import Playback, ReplayerConfig
from fish_bag.recover import recover
from fish_control.fusion import Fusion
from fish_control.nodes.messages import inertial_values
from fish_control.paths import polyline
from fish_control.reference_path import PathError, ReferencePath
from fish_node.camera_file import read_camera_file
from fish_vision.calibration import read_lens

ROBOT = {"joint_command": 60, "joint_states": 60, "imu/data": 60, "camera/pose": 18}
SHORT = {"joint_command": 20, "joint_states": 20, "imu/data": 20, "camera/pose": 6}


def holds(trial: Trial, counts: dict[str, int]) -> None:
    found = {topic.topic.removeprefix("/fish/"): topic.count for topic in trial.topics}
    assert {name: found.get(name) for name in counts} == counts, found


def has(trial: Trial, severity: str, kind: str, words: str = "") -> None:
    texts = [p.text for p in trial.problems if (p.severity, p.kind) == (severity, kind)]
    assert any(words in text for text in texts), [str(p) for p in trial.problems]


def recovered(path: Path) -> Trial:
    with tempfile.TemporaryDirectory() as folder:
        recover(path, Path(folder) / "out")
        return read_trial(Path(folder) / "out")


def refused(path: Path, *words: str) -> None:
    said = ""
    try:
        read_trial(path)
    except RecordingError as error:
        said = str(error)
    assert said, "it was read"
    assert all(word in said for word in words), said


def calibration_files(folder: Path) -> None:
    """One reader: fish_hw's camera node and fish_vision's tools and tracker take each of them."""
    models = {}
    for file in sorted(folder.glob("*.y*ml")):
        camera, lens = read_camera_file(file), read_lens(file)
        assert lens.size == (camera.width, camera.height) == (800, 600)
        assert lens.model == camera.model
        np.testing.assert_allclose(lens.D, camera.distortion)
        models[file.stem] = (camera.model, len(camera.distortion))
    plain = ("plumb_bob", 5)
    expected = {"equidistant": ("equidistant", 4), "four_coefficients": plain}
    assert models == {**expected, "no_coefficients": plain, "opencv_head": plain}, models


def fusion_frame(folder: Path) -> None:
    """The folder's feed.py against the node: 2 s of poses in pool, then 2 s in another frame."""
    environment = {"ROS_DOMAIN_ID": "166", **os.environ}
    command = [sys.executable, "-c", "from fish_control.nodes.entry import fusion; fusion()"]
    with subprocess.Popen(command, env=environment, stderr=subprocess.PIPE, text=True) as node:
        try:
            feed = [sys.executable, str(folder / "feed.py")]
            said = subprocess.run(
                feed, env=environment, capture_output=True, text=True, timeout=120
            )
        finally:
            node.send_signal(signal.SIGINT)
            logged = node.communicate(timeout=30)[1]
    found = dict(re.findall(r"^(\w+) x = (\S+)", said.stdout, flags=re.M))
    assert abs(float(found["pool"])) < 0.01, said.stdout
    assert abs(float(found["camera_optical"])) < 0.05, said.stdout
    assert logged.count("is not fused: its poses come in frame") == 1, logged


def fusion_not_measured() -> None:
    """An Imu message whose gyro is not measured, zeros in its place, and a camera that sees the fish turn."""
    fusion, errors = Fusion(), []
    for k in range(1500):
        t = 100.0 + 0.01 * k
        psi = 0.8 * math.sin(0.9 * (t - 100.0))
        message = Imu()
        message.angular_velocity_covariance[0] = -1.0
        message.orientation_covariance[0] = -1.0
        fusion.add_imu(t, *inertial_values(message))
        if k % 3 == 0:
            place = [0.3 * math.cos(0.2 * t), 0.2 * math.sin(0.3 * t), psi]
            fusion.add_pose(t, place, np.diag([1e-5, 1e-5, 1e-4]))
        estimate = fusion.estimate()
        if estimate is not None and k > 600:
            errors.append(estimate.pose[2] - psi)
    assert np.std(errors) < 0.02, f"heading rms {np.std(errors):.3f} rad, {dict(fusion.counts)}"


def swum(path: Path) -> ReferencePath:
    return polyline(str(path), size=1.0) if path.suffix == ".svg" else polyline(str(path))


def not_swum(path: Path, words: str) -> None:
    said = ""
    try:
        swum(path)
    except PathError as error:
        said = str(error)
    assert words in said, said or "it is swum"


def csv_columns(folder: Path) -> None:
    """Columns by their names; a row that is neither numbers nor names is an error of its line."""
    columns = np.genfromtxt(folder / "y_x.csv", delimiter=",", names=True)
    np.testing.assert_allclose(
        swum(folder / "y_x.csv").points[0], [columns["x"][0], columns["y"][0]]
    )
    not_swum(folder / "first_row.csv", "line 1")


def svg_not_drawn(folder: Path) -> None:
    """The line m 40,60 h 60 v 30 h -40 v 40 of which the longer side is 1 m; y points up."""
    corners = np.array([[40, -60], [100, -60], [100, -90], [60, -90], [60, -130]], float)
    ends = (corners[[0, -1]] - [70, -95]) / 70.0
    for name in ("marker.svg", "hidden.svg"):
        np.testing.assert_allclose(swum(folder / name).points[[0, -1]], ends, atol=1e-6)
    not_swum(folder / "two_lines.svg", "2 visible parts")


def svg_transform(folder: Path) -> None:
    """The drawings differ by a mirror and by a quarter of a turn; their middles lie at the pool's."""
    plain, mirrored, turned = (
        swum(folder / f"{name}.svg").points[[0, -1]] for name in ("plain", "mirrored", "turned")
    )
    np.testing.assert_allclose(mirrored, plain * [-1, 1], atol=1e-6)
    quarter = [plain[:, ::-1] * [s, -s] for s in (1, -1)]
    assert any(np.allclose(turned, points, atol=1e-6) for points in quarter), (plain, turned)


def foreign_topic(folder: Path) -> None:
    for file in sorted(folder.glob("*.mcap")):
        for trial in (read_trial(file), recovered(file)):
            holds(trial, ROBOT)
            has(trial, "info", "foreign_topic", "counted, not decoded")


def imu_not_measured(folder: Path) -> None:
    trial = read_trial(folder / "no_gyro")
    has(trial, "warning", "not_measured")
    assert trial.imu is not None
    assert np.isnan(trial.imu.gyro).all()
    fusion_not_measured()


def imu_units(folder: Path) -> None:
    has(read_trial(folder / "deg_per_s"), "error", "gyro_unit", "57.")


def lfs_pointer(folder: Path) -> None:
    refused(folder / "trial.mcap", "Git LFS pointer", "git lfs pull")


def mcap_index(folder: Path) -> None:
    holds(read_trial(folder / "chunk_index_only.mcap"), ROBOT)


def message_compression(folder: Path) -> None:
    holds(read_trial(folder / "with_metadata"), ROBOT)
    trial = recovered(folder / "with_metadata")
    holds(trial, ROBOT)
    assert trial.commands is not None
    assert not trial.commands.flags.any()


def metadata_only(folder: Path) -> None:
    for name, words in (("empty", "metadata.yaml is empty"), ("renamed", "renamed.mcap")):
        trial = read_trial(folder / name)
        holds(trial, SHORT)
        has(trial, "warning", "storage", words)


def qos_differs(folder: Path) -> None:
    path = folder / "all_topics"
    holds(read_trial(path), ROBOT)
    assert len(list(Playback(ReplayerConfig(str(path)), "/fish").messages())) == 198


def recover_zero_tail(folder: Path) -> None:
    path = folder / "half_message.mcap"
    with tempfile.TemporaryDirectory() as temporary:
        assert recover(path, Path(temporary) / "out").lost
    trial = recovered(path)
    assert trial.imu is not None
    assert len(trial.imu) == 20, "the 21st sample reaches into the zeros"
    true = np.column_stack([np.full(20, 1.0), 0.01 * np.arange(20), np.full(20, 9.81)])
    np.testing.assert_allclose(trial.imu.accel, true)


def ros1_active(folder: Path) -> None:
    path = folder / "run.bag.active"
    refused(path, "ROS 1 bag without index", "recover")
    assert sum(topic.count for topic in recovered(path).topics) > 0


def sqlite_parts(folder: Path) -> None:
    holds(read_trial(folder), ROBOT)
    holds(recovered(folder), ROBOT)


def sqlite_wal(folder: Path) -> None:
    trial = read_trial(folder / "killed")
    holds(trial, ROBOT)
    has(trial, "warning", "storage", "-wal")


def two_publishers(folder: Path) -> None:
    has(read_trial(folder / "interleaved"), "warning", "two_publishers", "200 Hz")


CASES: tuple[Callable[[Path], None], ...] = (
    calibration_files,
    csv_columns,
    foreign_topic,
    fusion_frame,
    imu_not_measured,
    imu_units,
    lfs_pointer,
    mcap_index,
    message_compression,
    metadata_only,
    qos_differs,
    recover_zero_tail,
    ros1_active,
    sqlite_parts,
    sqlite_wal,
    svg_not_drawn,
    svg_transform,
    two_publishers,
)


def main() -> int:
    if len(sys.argv) != 2 or not Path(sys.argv[1]).is_dir():
        given = sys.argv[1] if len(sys.argv) > 1 else "nothing"
        print(f"check_cases: {given}: no such folder; expected the folder with the cases")
        return 2
    wrong = 0
    for case in CASES:
        folder = Path(sys.argv[1]) / case.__name__
        try:
            if not folder.is_dir():
                raise AssertionError("the folder is absent")
            case(folder)
            print(f"right  {case.__name__}")
        except (AssertionError, RecordingError) as error:
            wrong += 1
            print(f"WRONG  {case.__name__}: {' '.join(str(error).split())[:300]}")
    return int(bool(wrong))


if __name__ == "__main__":
    sys.exit(main())
