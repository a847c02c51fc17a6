"""Real nodes in closed loop: a path is followed, killed nodes resume, a replay gives the same odometry."""

import math
import signal
from pathlib import Path

import numpy as np
import pytest
from conftest import CONTROLLER, FUSION, PLANNER, RECORDER, Run, parameters, running
from rosbags.highlevel import AnyReader

from fish_train.bringup import REPLAYER
from fish_train.recordings import read_trial
from fish_train.score import RunScore, score_trial

SHORT, SHORT_START = "{amplitude: 0.15, length: 1.2}", (-0.6, 0.0, math.atan(0.15 * math.pi / 0.6))
LONG, LONG_START = "{amplitude: 0.25, length: 2.0}", (-1.0, 0.0, math.atan(0.25 * math.pi))
FACTOR = 0.5  # simulated seconds in a second: time enough on a computer that does other things as well
CROSS_TRACK_RMSE, SPEED_RMSE = 0.03, 0.04  # m, m/s; on a quiet computer 0.010 and 0.024
SAME_POSITION, SAME_HEADING = 0.006, 0.03  # m, rad, at worst; the camera's noise is 0.002 m and 0.012 rad
STOP_WITHIN = 0.8  # s from the last estimate: 0.15 s until it is stale, 0.5 s in which the rotor runs down
RESUMED_WITHIN = 0.3  # m off the path at most, while a node is being started again and the fish glides


@pytest.fixture(scope="module")
def swum(tmp_path_factory) -> Path:
    """A recording of the sinusoid from end to end."""
    folder = tmp_path_factory.mktemp("swum")
    with running(folder, parameters(folder, "sinusoid", SHORT, SHORT_START, FACTOR)) as run:
        run.until(run.finished, "the end of the path")
        run.listen(0.5)  # the estimate may be there a little before the fish
        run.nodes.stop([RECORDER])
    return folder / "recording"


@pytest.fixture(scope="module")
def score(swum) -> RunScore:
    return score_trial(read_trial(swum))


def test_the_path_is_followed_to_its_end(score):
    assert score.source == "truth" and score.finished


def test_errors_are_as_small_as_stated(score):
    settled = score.summaries(with_approach=False)
    assert settled["cross-track, m"].rmse < CROSS_TRACK_RMSE
    assert settled["speed, m/s"].rmse < SPEED_RMSE


def test_the_estimate_is_close_to_the_truth(swum):
    t, estimate = odometry(swum, "/fish/odometry/filtered")
    t_true, truth = odometry(swum, "/fish/sim/odometry")
    both = (t >= t_true[0]) & (t <= t_true[-1])  # the recorder discovers one topic a little before the other
    expected = np.column_stack([np.interp(t[both], t_true, column) for column in truth.T])
    rms = np.sqrt(np.mean((estimate[both] - expected) ** 2, axis=0))
    assert rms[0] < 0.005 and rms[1] < 0.005  # m; the camera's noise is 0.002 m
    assert rms[2] < 0.03  # rad; 0.012 rad


def test_a_replay_through_fusion_gives_the_same_odometry(swum, tmp_path):
    settings = {
        RECORDER: {"output": str(tmp_path), "name": "recording", "topics": ["odometry/filtered"]},
        FUSION: {"use_sim_time": True},
        REPLAYER: {
            "recording": str(swum),
            "topics": ["camera/pose", "imu/data", "joint_states", "/clock"],
            "start_delay_s": 2.0,
        },
    }  # fmt: skip
    with running(tmp_path, settings, swims=False) as run:
        assert run.nodes.running[REPLAYER].wait(60.0) == 0
        run.nodes.stop([RECORDER])
    t, recorded = odometry(swum, "/fish/odometry/filtered")
    t_again, replayed = odometry(tmp_path / "recording", "/fish/odometry/filtered")
    common = (t > t_again[0] + 1.0) & (t < t_again[-1])  # after the filter has started
    measured, _ = messages(
        swum, "/fish/imu/data"
    )  # the recorder may have discovered this later than the odometry
    assert np.count_nonzero(common) > 0.7 * np.count_nonzero(t >= measured[0])
    difference = recorded[common] - np.column_stack(
        [np.interp(t[common], t_again, column) for column in replayed.T]
    )
    # the same measurements, but on a busy computer a pose may come in just before or after an estimate is sent
    assert np.abs(difference[:, :2]).max() < SAME_POSITION
    assert np.abs(difference[:, 2]).max() < SAME_HEADING


@pytest.mark.parametrize("spec", [PLANNER, FUSION, CONTROLLER], ids=lambda spec: spec.executable)
def test_a_killed_node_resumes(spec, resumed):
    before, planned, true = resumed.places[spec]  # m
    assert before - 0.05 < planned  # goes on where it was, not from the beginning
    assert abs(planned - true) < 0.15  # and leaves nothing out


def test_a_run_with_kills_ends_where_the_path_ends(resumed):
    score = score_trial(read_trial(resumed.recording))
    assert score.finished
    assert np.abs(score.cross_track).max() < RESUMED_WITHIN


def test_rotor_stops_and_rudder_centres_while_there_is_no_estimate(resumed):
    t, _ = messages(resumed.recording, "/fish/odometry/filtered")
    longest = int(np.argmax(np.diff(t)))  # fusion is being started again
    stopped, again = t[longest] + STOP_WITHIN, t[longest + 1]
    assert again > stopped + 0.2, "fusion was back too soon to see anything"
    stamps, commands = messages(resumed.recording, "/fish/joint_command")
    meanwhile = [c for stamp, c in zip(stamps, commands, strict=True) if stopped < stamp < again]
    assert len(meanwhile) > 10  # they do not just cease
    assert all(c.velocity[0] == 0.0 and c.position[1] == 0.0 for c in meanwhile)


class Resumed:
    """What was seen of a run in which nodes were killed."""

    def __init__(self, recording: Path) -> None:
        self.recording = recording
        self.places: dict[object, tuple[float, float, float]] = {}


@pytest.fixture(scope="module")
def resumed(tmp_path_factory) -> Resumed:
    """The sinusoid again; planner, fusion and controller are killed on the way, one after the other."""
    folder = tmp_path_factory.mktemp("resumed")
    seen = Resumed(folder / "recording")
    with running(folder, parameters(folder, "sinusoid", LONG, LONG_START, FACTOR)) as run:
        for spec, place in ((PLANNER, 0.4), (FUSION, 0.9), (CONTROLLER, 1.4)):
            run.until(lambda place=place: run.progress() > place, f"progress of {place} m")
            # on a fast computer fusion would be back before the fish could stop
            seen.places[spec] = kill_and_restart(run, spec, pause=1.5 if spec is FUSION else 0.0)
        run.until(run.finished, "the end of the path")
        run.listen(0.5)  # the estimate may be there a little before the fish
        run.nodes.stop([RECORDER])
    return seen


def kill_and_restart(run: Run, spec, pause: float) -> tuple[float, float, float]:
    """Progress [m] at the kill; 0.1 m further on, restarted after `pause` [s], the planner's and the true one."""
    process = run.nodes.running[spec]
    process.signal(signal.SIGKILL)
    assert process.wait(5.0) == -signal.SIGKILL
    before = run.progress()
    run.watch.diagnostics.clear()
    run.listen(pause)
    run.start(spec)
    run.until(lambda: run.progress() > before + 0.1, f"swimming on after the end of {spec.name}")
    run.watch.diagnostics.clear()  # what it said on the way here is old
    run.until(lambda: "progress_m" in run.watch.diagnostics.get("fish/planner", {}), "the planner's word")
    return before, float(run.watch.diagnostics["fish/planner"]["progress_m"]), run.progress()


def messages(recording: Path, topic: str) -> tuple[np.ndarray, list]:
    """Header stamps (N,) [s] and messages of a topic in order of stamp, read with rosbags alone."""
    stamped = []
    with AnyReader([recording]) as reader:
        connections = [c for c in reader.connections if c.topic == topic]
        for connection, _, data in reader.messages(connections=connections):
            message = reader.deserialize(data, connection.msgtype)
            stamped.append((message.header.stamp.sec + 1e-9 * message.header.stamp.nanosec, message))
    stamped.sort(key=lambda pair: pair[0])
    return np.array([stamp for stamp, _ in stamped]), [message for _, message in stamped]


def odometry(recording: Path, topic: str) -> tuple[np.ndarray, np.ndarray]:
    """Stamps (N,) [s] and x, y, heading (N, 3), unwrapped."""
    t, found = messages(recording, topic)
    poses = [message.pose.pose for message in found]
    heading = np.unwrap([2.0 * math.atan2(pose.orientation.z, pose.orientation.w) for pose in poses])
    return t, np.column_stack([[(pose.position.x, pose.position.y) for pose in poses], heading])
