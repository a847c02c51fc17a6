# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Static frames as messages."""

from fish_node.nodes.static_frames import static_transform


def test_a_transform_names_parent_and_child_and_holds_place_and_turn() -> None:
    message = static_transform("pool", "fish_2/camera", (0.1, 0.2, 3), (1, 0, 0, 0))
    assert (message.header.frame_id, message.child_frame_id) == ("pool", "fish_2/camera")
    place, turn = message.transform.translation, message.transform.rotation
    assert (place.x, place.y, place.z) == (0.1, 0.2, 3.0)
    assert (turn.x, turn.y, turn.z, turn.w) == (1.0, 0.0, 0.0, 0.0)
