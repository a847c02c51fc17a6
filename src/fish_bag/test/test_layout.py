# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The vectorised decoder against rosbags' own, on random messages of every layout."""

import numpy as np
import pytest
from rosbags.interfaces import Nodetype
from rosbags.typesys import get_types_from_msg

from fish_bag import message_build as build
from fish_bag.layout import (
    MAX_LAYOUTS,
    LayoutError,
    decode_blocks,
    find_layout,
)
from fish_bag.message_types import typestore

TYPES = {
    "sensor_msgs/msg/JointState": lambda r, n: build.joints(
        r.integers(1, 2**60),
        ["rotor", "rudder", "x"][: n % 4],
        r.normal(size=n % 4),
        r.normal(size=n % 3),
    ),
    "sensor_msgs/msg/Imu": lambda r, _n: build.imu(
        r.integers(1, 2**60), r.normal(size=3), r.normal(size=3), r.normal(size=4)
    ),
    "geometry_msgs/msg/PoseWithCovarianceStamped": lambda r, n: build.camera_pose(
        r.integers(1, 2**60), "p" * (n % 9), r.normal(size=3), r.uniform(size=3)
    ),
    "nav_msgs/msg/Odometry": lambda r, _n: build.odometry(
        r.integers(1, 2**60), r.normal(size=3), r.normal(size=3)
    ),
    "sensor_msgs/msg/BatteryState": lambda r, _n: build.battery(
        r.integers(1, 2**60), r.uniform(9, 12)
    ),
    "std_msgs/msg/Float64MultiArray": lambda r, n: build.labelled_numbers(
        "a" * (n % 6), r.normal(size=n % 7)
    ),
    "nav_msgs/msg/Path": lambda r, n: build.path(
        r.integers(1, 2**60), "pool", r.normal(size=(n % 5, 2))
    ),
    "std_msgs/msg/Float64": lambda r, _n: build.number(r.normal()),
}


def flatten(message, prefix=""):
    """Path -> value of every field of a rosbags message object, in the decoder's naming."""
    store = typestore()
    for name, (kind, what) in store.fielddefs[message.__msgtype__][1]:
        value, path = getattr(message, name), f"{prefix}{name}"
        if kind == Nodetype.NAME:
            yield from flatten(value, f"{path}.")
        elif kind in (Nodetype.ARRAY, Nodetype.SEQUENCE) and what[0][0] == Nodetype.NAME:
            for i, item in enumerate(value):
                yield from flatten(item, f"{path}.{i}.")
        else:
            yield path, value


@pytest.mark.parametrize("msgtype", TYPES)
@pytest.mark.parametrize("little_endian", [True, False])
def test_agrees_with_rosbags(msgtype, little_endian):
    rng = np.random.default_rng(3)
    store = typestore()
    sent = [TYPES[msgtype](rng, n) for n in range(40)]
    raws = [bytes(store.serialize_cdr(m, msgtype, little_endian=little_endian)) for m in sent]
    blocks, bad = decode_blocks(raws, msgtype, store.fielddefs)
    assert not len(bad)
    assert sorted(np.concatenate([b.index for b in blocks]).tolist()) == list(range(40))
    for block in blocks:
        for row, i in enumerate(block.index):
            for path, value in flatten(store.deserialize_cdr(raws[i], msgtype)):
                if isinstance(value, str) or (isinstance(value, list) and path in block.texts):
                    assert block.texts[path] == ([value] if isinstance(value, str) else value)
                else:
                    np.testing.assert_array_equal(block.values[path][row], value, err_msg=path)


def test_padding_bytes_do_not_split_layouts():
    """Other DDS implementations leave garbage in alignment padding."""
    store = typestore()
    raw = bytearray(
        store.serialize_cdr(build.joints(5, ["rotor"], [1.0], [2.0]), "sensor_msgs/msg/JointState")
    )
    other = bytearray(raw)
    other[4 + 13] = 0xAB  # behind the empty frame_id, before the next length
    blocks, bad = decode_blocks(
        [bytes(raw), bytes(other)], "sensor_msgs/msg/JointState", store.fielddefs
    )
    assert len(blocks) == 1
    assert not len(bad)


@pytest.mark.parametrize("cut", [0, 3, 10, 50, 90])
def test_short_messages_are_named_not_read(cut):
    store = typestore()
    raw = bytes(
        store.serialize_cdr(build.joints(5, ["rotor"], [1.0], [2.0]), "sensor_msgs/msg/JointState")
    )
    if cut >= len(raw):
        pytest.skip("cut beyond the message")
    blocks, bad = decode_blocks(
        [raw, raw[:cut], raw], "sensor_msgs/msg/JointState", store.fielddefs
    )
    assert bad.tolist() == [1]
    assert blocks[0].index.tolist() == [0, 2]


def test_layouts_beyond_the_limit_are_left_out():
    store, msgtype = typestore(), "std_msgs/msg/Float64MultiArray"
    raws = [
        bytes(store.serialize_cdr(build.labelled_numbers(f"{n:04d}", [1.0]), msgtype))
        for n in range(MAX_LAYOUTS + 3)
    ]
    blocks, bad = decode_blocks([*raws, raws[0]], msgtype, store.fielddefs)
    assert len(blocks) == MAX_LAYOUTS
    assert blocks[0].index.tolist() == [0, MAX_LAYOUTS + 3]
    assert bad.tolist() == [MAX_LAYOUTS, MAX_LAYOUTS + 1, MAX_LAYOUTS + 2]


def test_absurd_length_is_refused():
    store = typestore()
    raw = bytearray(
        store.serialize_cdr(build.joints(5, ["rotor"], [1.0], [2.0]), "sensor_msgs/msg/JointState")
    )
    raw[4 + 8 : 4 + 12] = b"\xff\xff\xff\x7f"  # frame_id of 2 GB
    with pytest.raises(LayoutError, match="fields need more"):
        find_layout(bytes(raw), "sensor_msgs/msg/JointState", store.fielddefs, ros1=False)


@pytest.mark.parametrize(
    "definition",
    [
        "sensor_msgs/Imu x",
        f"sensor_msgs/Foo[1000000000] x\n{'=' * 80}\nMSG: sensor_msgs/Foo\n",
        f"sensor_msgs/Foo a\nsensor_msgs/Foo b\n{'=' * 80}\nMSG: sensor_msgs/Foo\nsensor_msgs/Imu y\nsensor_msgs/Imu z",
    ],
    ids=["itself", "many empty ones", "two of each other"],
)
def test_types_without_end_or_fields_are_refused(definition):
    types = get_types_from_msg(definition, "sensor_msgs/msg/Imu")
    with pytest.raises(LayoutError, match="no end or no fields"):
        find_layout(bytes([0, 1, 0, 0]) + bytes(40), "sensor_msgs/msg/Imu", types, ros1=False)


def test_ros1_layout_has_no_alignment():
    store = typestore(ros1=True)
    types = store.types
    time = types["builtin_interfaces/msg/Time"](sec=7, nanosec=8)
    header = types["std_msgs/msg/Header"](seq=3, stamp=time, frame_id="abc")
    joint = types["sensor_msgs/msg/JointState"](
        header=header,
        name=["rotor"],
        position=np.array([1.5]),
        velocity=np.array([2.5]),
        effort=np.zeros(0),
    )
    raw = bytes(store.serialize_ros1(joint, "sensor_msgs/msg/JointState"))
    blocks, bad = decode_blocks(
        [raw, raw], "sensor_msgs/msg/JointState", store.fielddefs, ros1=True
    )
    assert not len(bad)
    assert blocks[0].values["position"].tolist() == [[1.5], [1.5]]
    assert blocks[0].values["header.stamp.sec"].tolist() == [7, 7]
    assert blocks[0].texts["name"] == ["rotor"]
