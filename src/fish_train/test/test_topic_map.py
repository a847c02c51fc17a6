"""The topic map: the YAML file holds the defaults, mistakes are named."""

from pathlib import Path

import pytest
import yaml

from fish_train.recordings import RecordingError, TopicMap, load_topic_map

FILE = Path(__file__).parents[1] / "config" / "topics.yaml"


def test_file_holds_the_defaults():
    assert yaml.safe_load(FILE.read_text()) == TopicMap().as_dict()
    assert load_topic_map(FILE) == TopicMap()


def test_partial_file(tmp_path):
    (tmp_path / "t.yaml").write_text(
        "namespace: /x\ntopics: {imu: /imu/raw, tail: null, camera: {frame: map}}"
    )
    topics = load_topic_map(tmp_path / "t.yaml")
    assert topics.namespace == "/x"
    assert topics.rules["imu"].topic == "/imu/raw" and topics.rules["imu"].frame == "imu_link"
    assert "tail" not in topics.rules
    assert topics.rules["camera"].frame == "map" and topics.rules["camera"].required


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("topics: {sonar: /x}", "unknown role 'sonar'"),
        ("topics: {imu: {topc: /x}}", "expected a topic name or keys topic"),
        ("topics: {imu: {time: noon}}", "'noon'; expected stamp or arrival"),
        ("speed: 3", "unknown keys"),
        ("- 1", "unknown keys"),
        ("a: [", "cannot be read"),
        ("max_latency_s: 0", "expected > 0"),
    ],
)
def test_mistakes(tmp_path, text, message):
    (tmp_path / "t.yaml").write_text(text)
    with pytest.raises(RecordingError, match=message):
        load_topic_map(tmp_path / "t.yaml")
