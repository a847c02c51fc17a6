# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Two fish swim at once on one ROS domain, each in its own pool, and do not hear each other."""

import math

import pytest
from rosbags.highlevel import AnyReader

from conftest import RECORDER, parameters, running
from fish_bag import read_trial
from fish_bringup.score import score_trial
from fish_node.domain import choose_domain

SHARED = ("/diagnostics", "/parameter_events", "/rosout", "/tf", "/tf_static")
SECOND = "/fish_2"
LENGTH = "{length: 1.2}"
SINE, SINE_START = "{amplitude: 0.15, length: 1.2}", (-0.6, 0.0, math.atan(0.15 * math.pi / 0.6))
FACTOR, LOCKSTEP = 1.0, 60.0  # as in test_demo


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
    first = parameters(folders[0], "straight", LENGTH, (-0.6, 0.0, 0.0), FACTOR, LOCKSTEP)
    second = parameters(folders[1], "sinusoid", SINE, SINE_START, FACTOR, LOCKSTEP)
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
    assert settled["cross-track, m"].rmse < 0.03
    assert settled["speed, m/s"].rmse < 0.04


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
