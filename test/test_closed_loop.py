# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Real nodes in closed loop: a path is followed, killed nodes resume, a replay gives the same odometry."""

import math
import signal
import time
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest
from rosbags.highlevel import AnyReader
from sensor_msgs.msg import JointState
from std_msgs.msg import Header

from conftest import CONTROLLER, FUSION, PATIENCE, PLANNER, RECORDER, Run, parameters, running
from fish_bag import read_trial
from fish_bringup.node_table import REPLAYER, NodeSpec
from fish_bringup.score import RunScore, score_trial

SHORT, SHORT_START = "{amplitude: 0.15, length: 1.2}", (-0.6, 0.0, math.atan(0.15 * math.pi / 0.6))
LONG, LONG_START = (
    "{amplitude: 0.25, length: 2.6}",
    (-1.3, 0.0, math.atan(0.25 * 2.0 * math.pi / 2.6)),
)
LOCKSTEP = 5.0  # s of real time that the simulator waits for estimates and commands
# simulated seconds in a second: time enough on a computer that does other things as well
FACTOR = 0.5
CROSS_TRACK_RMSE, SPEED_RMSE = 0.03, 0.04  # m, m/s; on a quiet computer 0.010 and 0.024
SAME_POSITION, SAME_HEADING = (
    0.006,
    0.03,
)  # m, rad, in 95 % of them; the noise is 0.002 m and 0.012 rad
# s from the last estimate: 0.15 s until it is stale, 0.5 s in which the rotor runs down
STOP_WITHIN = 0.8
GLIDE = 1.0  # m at most without a node and until the planner speaks again
BACK_WITHIN, BACK_FOR = (
    0.1,
    0.2,
)  # m off the path at most, over this much [m] of its end: all is as before


@pytest.fixture(scope="module")
def swum(tmp_path_factory) -> Path:
    """A recording of the sinusoid from end to end."""
    folder = tmp_path_factory.mktemp("swum")
    with running(
        folder, parameters(folder, "sinusoid", SHORT, SHORT_START, FACTOR, LOCKSTEP)
    ) as run:
        run.until(run.finished, "the end of the path")
        run.listen(0.5)  # the estimate may be there a little before the fish
        run.nodes.stop([RECORDER])
    return folder / "recording"


@pytest.fixture(scope="module")
def score(swum) -> RunScore:
    return score_trial(read_trial(swum))


def test_the_path_is_followed_to_its_end(score):
    assert score.source == "truth"
    assert score.finished


def test_errors_are_as_small_as_stated(score):
    settled = score.summaries(with_approach=False)
    assert settled["cross-track, m"].rmse < CROSS_TRACK_RMSE
    assert settled["speed, m/s"].rmse < SPEED_RMSE


def test_the_estimate_is_close_to_the_truth(swum):
    t, estimate = odometry(swum, "/fish/odometry/filtered")
    t_true, truth = odometry(swum, "/fish/sim/odometry")
    both = (t >= t_true[0]) & (
        t <= t_true[-1]
    )  # the recorder discovers one topic a little before the other
    expected = np.column_stack([np.interp(t[both], t_true, column) for column in truth.T])
    rms = np.sqrt(np.mean((estimate[both] - expected) ** 2, axis=0))
    assert rms[0] < 0.005
    assert rms[1] < 0.005
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
    }
    with running(tmp_path, settings, swims=False) as run:
        assert run.nodes.running[REPLAYER].wait(300.0) == 0
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
    usual = np.quantile(np.abs(difference), 0.95, axis=0)
    assert usual[0] < SAME_POSITION
    assert usual[1] < SAME_POSITION
    assert usual[2] < SAME_HEADING


@pytest.mark.parametrize("spec", [PLANNER, FUSION, CONTROLLER], ids=lambda spec: spec.executable)
def test_a_killed_node_resumes(spec, resumed):
    places = resumed.places[spec]
    assert (
        places.lowest > places.before - 0.3
    )  # goes on where it was, not from the beginning; its last word may be old
    assert places.planned < places.before + GLIDE  # and leaves nothing out


def test_no_node_uses_the_shared_memory_that_a_kill_can_spoil(resumed):
    assert resumed.mapped
    assert not [line for line in resumed.mapped if "/dev/shm/fastrtps" in line]


def test_a_run_with_kills_is_back_on_the_path_at_its_end(resumed):
    score = score_trial(read_trial(resumed.recording))
    assert score.finished
    # how far the fish glides meanwhile depends on how long this computer needs to start a node again
    assert np.abs(score.cross_track).max() < GLIDE
    last = score.progress > score.path.length - BACK_FOR
    assert np.abs(score.cross_track[last]).max() < BACK_WITHIN


def test_rotor_stops_and_rudder_centres_while_there_is_no_estimate(resumed):
    t, estimates = messages(resumed.recording, "/fish/odometry/filtered")
    last = t[np.array([e.arrival for e in estimates]) < resumed.places[FUSION].restarted].max()
    meanwhile = [
        command.message
        for stamp, command in zip(*messages(resumed.recording, "/fish/joint_command"), strict=True)
        if stamp > last + STOP_WITHIN and command.arrival < resumed.places[FUSION].restarted
    ]
    assert len(meanwhile) > 10  # they do not just cease
    assert all(c.velocity[0] == 0.0 and c.position[1] == 0.0 for c in meanwhile)


@dataclass(frozen=True)
class Places:
    """Progress along the path [m] around the restart of a node."""

    before: float  # true, at the kill
    lowest: float  # that the planner spoke of until it was further on
    planned: float  # by the planner, when fish and planner were further on and agreed
    restarted: float  # time of the computer [s] when the node was started again


@dataclass(frozen=True)
class Resumed:
    """What was seen of a run in which nodes were killed."""

    recording: Path
    places: dict[NodeSpec, Places] = field(default_factory=dict)
    mapped: list[str] = field(default_factory=list)  # memory of every node, /proc/PID/maps


@pytest.fixture(scope="module")
def resumed(tmp_path_factory) -> Resumed:
    """The sinusoid again; planner, fusion and controller are killed on the way, one after the other."""
    folder = tmp_path_factory.mktemp("resumed")
    seen = Resumed(folder / "recording")
    settings = parameters(folder, "sinusoid", LONG, LONG_START, FACTOR, LOCKSTEP)
    with running(folder, settings) as run:
        for spec, place in ((PLANNER, 0.4), (FUSION, 0.9), (CONTROLLER, 1.4)):
            run.until(lambda place=place: run.progress() > place, f"progress of {place} m")
            # without estimates the fish is to stop, which takes a while
            seen.places[spec] = kill_and_restart(run, spec, pause=1.5 if spec is FUSION else 0.0)
        run.until(run.finished, "the end of the path")
        run.listen(0.5)  # the estimate may be there a little before the fish
        for node in run.nodes.running.values():
            seen.mapped.extend(Path(f"/proc/{node.pid}/maps").read_text().splitlines())
        run.nodes.stop([RECORDER])
    return seen


def kill_and_restart(run: Run, spec, pause: float) -> Places:
    """Kill a node, start it again after `pause` [simulated s] and swim on until the planner is 0.1 m further."""
    process = run.nodes.running[spec]
    process.signal(signal.SIGKILL)
    assert process.wait(5.0) == -signal.SIGKILL
    before, words = run.progress(), []
    swim_without_estimates(run, pause)
    restarted = time.time()
    run.start(spec)

    def further() -> (
        bool
    ):  # this test may hear a new estimate before the planner does, and the planner speaks once a second
        words.append(planned(run))
        return words[-1] > before + 0.1 and abs(words[-1] - run.progress()) < 0.15

    run.until(further, f"the planner being where the fish is after the end of {spec.name}")
    return Places(before, float(np.nanmin(words)), words[-1], restarted)


def swim_without_estimates(run: Run, duration: float) -> None:
    """Until the commands are so much [simulated s] younger than the last estimate."""
    commands: list[JointState] = []
    subscription = run.watch.create_subscription(JointState, "joint_command", commands.append, 50)
    deadline = time.monotonic() + PATIENCE
    while duration and not (
        commands and seconds(commands[-1].header) > run.watch.sight.stamp + duration
    ):
        assert time.monotonic() < deadline, (
            f"no commands over {duration:g} s within {PATIENCE:.0f} s"
        )
        run.listen(0.05)
    run.watch.destroy_subscription(subscription)


def seconds(header: Header) -> float:
    """Stamp [s]."""
    return header.stamp.sec + 1e-9 * header.stamp.nanosec


def planned(run: Run) -> float:
    """Arc length [m] of which the planner spoke last."""
    return float(run.watch.diagnostics.get("fish/planner", {}).get("progress_m", "nan"))


@dataclass(frozen=True)
class Heard:
    """A recorded message."""

    stamp: float  # s, of its header
    arrival: float  # s, time of the computer
    message: object


def messages(recording: Path, topic: str) -> tuple[np.ndarray, list[Heard]]:
    """Header stamps (N,) [s] and messages of a topic in order of stamp, read with rosbags alone."""
    heard = []
    with AnyReader([recording]) as reader:
        connections = [c for c in reader.connections if c.topic == topic]
        for connection, arrival, data in reader.messages(connections=connections):
            message = reader.deserialize(data, connection.msgtype)
            stamp = seconds(message.header)
            heard.append(Heard(stamp, 1e-9 * arrival, message))
    heard.sort(key=lambda h: h.stamp)
    return np.array([h.stamp for h in heard]), heard


def odometry(recording: Path, topic: str) -> tuple[np.ndarray, np.ndarray]:
    """Stamps (N,) [s] and x, y, heading (N, 3), unwrapped."""
    t, found = messages(recording, topic)
    poses = [heard.message.pose.pose for heard in found]
    heading = np.unwrap(
        [2.0 * math.atan2(pose.orientation.z, pose.orientation.w) for pose in poses]
    )
    return t, np.column_stack([[(pose.position.x, pose.position.y) for pose in poses], heading])
