# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Fields of a message type: as the recording defines them, or as the common interfaces do."""

from __future__ import annotations

from functools import lru_cache

from rosbags.interfaces.typing import Typesdict
from rosbags.typesys import get_types_from_idl, get_types_from_msg

from fish_bag.message_types import typestore
from fish_bag.storage import StoredTopic

IDL_PARTS = "=" * 80 + "\n"


def types_of(topic: StoredTopic) -> tuple[Typesdict, str]:
    """Types by name with which the topic's messages are decoded, and what is wrong with the definition ("": nothing)."""
    return _types(topic.type, topic.encoding, topic.definition, topic.serialization == "ros1")


@lru_cache(maxsize=256)
def _types(name: str, encoding: str, definition: bytes, ros1: bool) -> tuple[Typesdict, str]:
    """The same texts come again with every trial of a data set."""
    types: Typesdict = dict(typestore(ros1).fielddefs)
    if not definition.strip():
        return types, ""
    try:
        text = definition.decode()
        if encoding in ("ros2msg", "ros1msg"):
            types.update(get_types_from_msg(text, name))
        elif encoding in ("ros2idl", "omgidl"):
            types.update(_from_idl(text))
        else:
            return types, f"its definition is written in {encoding or 'an unknown language'!r}"
    except Exception as error:  # the parser raises its own errors and, on odd texts, any other
        said = " ".join(str(error).split())[:200]
        return dict(typestore(ros1).fielddefs), f"its definition cannot be parsed ({said})"
    return types, ""


def _from_idl(text: str) -> Typesdict:
    types: Typesdict = {}
    for part in text.split(IDL_PARTS):
        idl = part.split("\n", 1)[1] if part.startswith("IDL: ") else part
        if idl.strip():
            types.update(get_types_from_idl(idl))
    return types
