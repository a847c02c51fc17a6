# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The closed loop through processes: by odometry, by camera, and two fish at once."""

import math
import signal
import time
from dataclasses import dataclass, field, replace
from math import pi, sin
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
from fish_node.domain import choose_domain
from fish_sim.camera import CameraConfig, FishPose, PoolRenderer
from fish_vision.calibration import Calibration, Lens, read_lens
from fish_vision.config import TrackerConfig
from fish_vision.picture import from_compressed
from fish_vision.pose import wrap
from fish_vision.tracker import Detection, Lost, Tracker

SHORT, SHORT_START = "{amplitude: 0.15, length: 1.2}", (-0.6, 0.0, math.atan(0.15 * math.pi / 0.6))
LONG, LONG_START = (
    "{amplitude: 0.25, length: 2.6}",
    (-1.3, 0.0, math.atan(0.25 * 2.0 * math.pi / 2.6)),
)
LOCKSTEP = 5.0  # s of real time that the simulator waits for estimates and commands
# simulated seconds in a second: time enough on a computer that does other things as well
FACTOR = 0.5
# m, m/s; 0.010 to 0.013 and 0.024 to 0.040 from run to run, as the noise differs with the moment of arming
CROSS_TRACK_RMSE, SPEED_RMSE = 0.03, 0.06
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


CAMERA, TRACKER = CameraConfig(), TrackerConfig()
LENS_FILE = Path(__file__).parents[1] / "src" / "fish_vision" / "config" / "simulated_camera.yaml"


@pytest.fixture(scope="module")
def renderer() -> PoolRenderer:
    return PoolRenderer(CAMERA.model(), CAMERA.shape(), CAMERA.look())


@pytest.fixture(scope="module")
def calibration() -> Calibration:
    model = CAMERA.model()
    lens = Lens.from_camera_info(
        *model.size, "plumb_bob", model.K.ravel().tolist(), model.D.tolist()
    )
    return Calibration(lens, TRACKER.mount())


def errors(found: Detection, pose: FishPose) -> np.ndarray:
    """x, y (m), heading (rad)."""
    head = found.head
    return np.array([head.x - pose.x, head.y - pose.y, wrap(head.heading - pose.heading)])


def anywhere(count: int, seed: int) -> list[FishPose]:
    """Poses over the whole pool, up to a head's length from the walls."""
    random = np.random.default_rng(seed)
    return [
        FishPose(
            random.uniform(-2.06, 2.06),
            random.uniform(-0.99, 0.99),
            random.uniform(-pi, pi),
            tuple(random.uniform(-0.35, 0.35, 3)),
        )
        for _ in range(count)
    ]


def test_pose_errors_over_the_whole_pool(renderer: PoolRenderer, calibration: Calibration) -> None:
    pairs = []
    for k, pose in enumerate(poses := anywhere(150, seed=11)):
        image = from_compressed(
            renderer.jpeg(renderer.render([pose], 0.37 * k)), CAMERA.model().size
        )
        found = Tracker(TRACKER, calibration).track(image, 0.0)
        if isinstance(found, Detection):
            pairs.append((found, pose))
    assert len(pairs) >= 0.99 * len(poses)
    error = np.array([errors(*pair) for pair in pairs])
    rms = np.sqrt(np.mean(error**2, axis=0))
    assert np.hypot(rms[0], rms[1]) < 1e-3
    assert rms[2] < 0.008
    bends = np.array([np.subtract(f.tail, p.tail) for f, p in pairs if f.tail is not None])
    assert len(bends) > 0.9 * len(pairs)
    assert np.sqrt(np.mean(bends**2, axis=0)).max() < 0.06
    whitened = [
        e @ np.linalg.solve(f.head.covariance, e) / 3
        for e, (f, _) in zip(error, pairs, strict=True)
    ]
    assert 0.2 < np.mean(whitened) < 2.0  # the stated covariance is about the true one


def test_a_swimming_fish_is_followed_through_the_glare(
    renderer: PoolRenderer, calibration: Calibration
) -> None:
    tracker, lost, error = Tracker(TRACKER, calibration), 0, []
    for k in range(
        300
    ):  # 10 s at 0.4 m/s along the lamps' mirror images, the head swinging at 2 Hz
        t = k / 30.0
        pose = FishPose(
            -2.0 + 0.4 * t, 0.55 + 0.08 * sin(t), 0.25 * sin(4 * pi * t), (0.2 * sin(9 * t),) * 3
        )
        image = from_compressed(renderer.jpeg(renderer.render([pose], t)), CAMERA.model().size)
        found = tracker.track(image, t)
        if isinstance(found, Lost):
            lost += 1
        else:
            error.append(errors(found, pose))
    assert lost <= 0.01 * 300
    rms = np.sqrt(np.mean(np.square(error), axis=0))
    assert np.hypot(rms[0], rms[1]) < 2e-3
    assert rms[2] < 0.012


def test_default_files_of_camera_and_tracker_agree() -> None:
    lens, model = read_lens(LENS_FILE), CAMERA.model()
    np.testing.assert_allclose(lens.K, model.K)
    np.testing.assert_allclose(lens.D, model.D)
    assert lens.size == model.size
    assert TRACKER.camera_position == CAMERA.camera_position
    assert TRACKER.camera_tilt == CAMERA.camera_tilt
    shape = CAMERA.shape()
    assert TRACKER.front_marker[0] == shape.front_marker
    assert TRACKER.rear_marker[0] == shape.rear_marker
    assert (TRACKER.marker_diameter, TRACKER.tail_marker_diameter) == (
        shape.marker_diameter,
        shape.tail_marker_diameter,
    )
    assert (TRACKER.hinge_offset, TRACKER.tail_links) == (shape.hinge_offset, shape.links)
    assert TRACKER.link_length == pytest.approx(shape.link_length)


def test_a_tilted_camera_elsewhere_works_as_well() -> None:
    camera = replace(
        CAMERA,
        camera_position=(-0.8, 0.5, 3.6),
        camera_tilt=(0.12, -0.2, 0.6),
        focal=(760.0, 765.0),
    )
    tracker = replace(
        TRACKER, camera_position=camera.camera_position, camera_tilt=camera.camera_tilt
    )
    model = camera.model()
    renderer = PoolRenderer(model, camera.shape(), replace(camera.look(), glare=0.0))
    lens = Lens.from_camera_info(
        *model.size, "plumb_bob", model.K.ravel().tolist(), model.D.tolist()
    )
    calibration = Calibration(lens, tracker.mount())
    found = []
    for pose in (p for p in anywhere(60, seed=3) if abs(p.x) < 1.4):
        result = Tracker(tracker, calibration).track(renderer.render([pose], 0.0), 0.0)
        assert isinstance(result, Detection)
        found.append(errors(result, pose))
    rms = np.sqrt(np.mean(np.square(found), axis=0))
    assert np.hypot(rms[0], rms[1]) < 2e-3
    assert rms[2] < 0.012


SHARED = ("/diagnostics", "/parameter_events", "/rosout", "/tf", "/tf_static")
SECOND = "/fish_2"
LENGTH = "{length: 1.2}"
SINE, SINE_START = "{amplitude: 0.15, length: 1.2}", (-0.6, 0.0, math.atan(0.15 * math.pi / 0.6))
TWO_FISH_FACTOR, TWO_FISH_LOCKSTEP = 1.0, 60.0  # as in test_demo


def heard_by(watch, namespace):
    """Topics that the nodes of a namespace subscribe to."""
    return {
        topic
        for name, own in watch.get_node_names_and_namespaces()
        if own == namespace
        for topic, _ in watch.get_subscriber_names_and_types_by_node(name, own)
    }


@pytest.fixture(scope="module")
def pair(tmp_path_factory):
    """Recordings of both, and what the nodes of each subscribe to."""
    domain, folders = choose_domain(), [tmp_path_factory.mktemp(name) for name in ("one", "two")]
    first = parameters(
        folders[0], "straight", LENGTH, (-0.6, 0.0, 0.0), TWO_FISH_FACTOR, TWO_FISH_LOCKSTEP
    )
    second = parameters(
        folders[1], "sinusoid", SINE, SINE_START, TWO_FISH_FACTOR, TWO_FISH_LOCKSTEP
    )
    with (
        running(folders[0], first, domain=domain) as one,
        running(folders[1], second, domain=domain, namespace=SECOND) as two,
    ):
        heard = {n: heard_by(one.watch, n) for n in ("/fish", SECOND)}
        one.until(one.finished, "the end of the first path")
        two.until(two.finished, "the end of the second path")
        for run in (one, two):
            run.listen(0.5)
            run.nodes.stop([RECORDER])
    return [folder / "recording" for folder in folders], heard


@pytest.mark.parametrize("which", [0, 1])
def test_each_swims_its_own_path_as_well_as_alone(pair, which):
    score = score_trial(read_trial(pair[0][which]))
    assert score.finished
    settled = score.summaries(with_approach=False)
    assert settled["cross-track, m"].rmse < CROSS_TRACK_RMSE
    assert settled["speed, m/s"].rmse < SPEED_RMSE


def test_no_node_subscribes_to_a_topic_of_the_other(pair):
    heard = pair[1]
    for own, other in (("/fish/", f"{SECOND}/"), (f"{SECOND}/", "/fish/")):
        topics = heard[own.rstrip("/")]
        assert any(topic.startswith(own) for topic in topics)
        assert not [topic for topic in topics if topic.startswith(other)]
    assert "/clock" not in heard[SECOND]
    assert f"{SECOND}/clock" in heard[SECOND]
    strange = {t for t in heard[SECOND] if not t.startswith(f"{SECOND}/")} - set(SHARED)
    assert strange == set()


def test_each_recording_holds_its_own_fish_and_frames(pair):
    for path, own, prefix in zip(pair[0], ("/fish/", f"{SECOND}/"), ("", "fish_2/"), strict=True):
        with AnyReader([path]) as reader:
            topics = set(reader.topics)
            assert {t for t in topics if not t.startswith(own)} <= {*SHARED, "/clock"}
            (odometry,) = [c for c in reader.connections if c.topic == f"{own}odometry/filtered"]
            _, _, raw = next(reader.messages([odometry]))
            message = reader.deserialize(raw, odometry.msgtype)
            assert (message.header.frame_id, message.child_frame_id) == (
                "pool",
                f"{prefix}base_link",
            )
    assert f"{SECOND}/clock" in topics
    assert "/clock" not in topics
