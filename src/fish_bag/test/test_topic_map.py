# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The topic map: the YAML file holds the defaults, mistakes are named."""

from dataclasses import asdict
from pathlib import Path

import pytest
import yaml

from fish_bag import RecordingError, TopicMap, load_topic_map

FILE = Path(__file__).parents[1] / "config" / "topics.yaml"


def test_file_holds_the_defaults():
    assert load_topic_map(FILE) == TopicMap()
    written = yaml.safe_load(FILE.read_text())
    assert set(written) == {"namespace", "max_latency_s", "topics"}
    assert written["topics"] == {role: asdict(rule) for role, rule in TopicMap().rules.items()}


def test_partial_file(tmp_path):
    (tmp_path / "t.yaml").write_text(
        "namespace: /x\ntopics: {imu: /imu/raw, tail: null, camera: {frame: map}}"
    )
    topics = load_topic_map(tmp_path / "t.yaml")
    assert topics.namespace == "/x"
    assert topics.rules["imu"].topic == "/imu/raw"
    assert topics.rules["imu"].frame == "imu_link"
    assert "tail" not in topics.rules
    assert topics.rules["camera"].frame == "map"
    assert topics.rules["camera"].required


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("topics: {sonar: /x}", "role sonar: unknown; known: commands"),
        ("topics: {sonar: {frame: x}}", "role sonar: unknown; known: commands"),
        ("topics: {imu: {topc: /x}}", "expected a mapping with keys topic"),
        ("topics: {imu: 3}", "got 3; expected a mapping with keys topic"),
        ("topics: {imu: {topic: [a]}}", "got topic .'a'.; expected text"),
        ("topics: {imu: {required: often}}", "expected true or false"),
        ("topics: {imu: {time: noon}}", "'noon'; expected stamp or arrival"),
        ("topics: [imu]", "got topics .'imu'.; expected a mapping"),
        ("{speed: 3, 1: 2}", "expected a mapping with keys namespace"),
        ("- 1", "expected a mapping with keys namespace"),
        ("a: [", "is not YAML"),
        ("max_latency_s: 2020-13-45", "is not YAML"),
        ("max_latency_s: 0", "expected > 0"),
        ("max_latency_s: long", "got max_latency_s 'long'; expected a number"),
        ("namespace: 7", "got namespace 7; expected text"),
    ],
)
def test_mistakes(tmp_path, text, message):
    (tmp_path / "t.yaml").write_text(text)
    with pytest.raises(RecordingError, match=message):
        load_topic_map(tmp_path / "t.yaml")
