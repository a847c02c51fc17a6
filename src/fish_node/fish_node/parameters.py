# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Names and types of parameters, and what a dataclass of them says of itself, without ROS.

A dataclass holds units and meaning in the comments of its fields, and ranges in its refusals. The nodes' parameter descriptors
and the reference page of the documentation are both made from this.
"""

from __future__ import annotations

import dataclasses
import inspect
import io
import re
import tokenize
from collections.abc import Collection, Iterable
from difflib import get_close_matches
from typing import Any

ROS_NAMES = (
    "use_sim_time",
    "start_type_description_service",
)  # and qos_overrides: ROS's own parameters


def in_type_of(name: str, given: Any, like: Any) -> Any:
    """given in the type of like: whole numbers may stand for floats, lists for tuples, YAML 1.1's truth values for Y and N.

    Raises:
        ValueError: another type; names the parameter, what came and what was expected.
    """
    if (
        isinstance(like, tuple)
        and not isinstance(given, str | bytes)
        and hasattr(given, "__iter__")
    ):
        return tuple(in_type_of(name, item, like[0]) for item in given)
    if isinstance(like, float) and isinstance(given, int) and not isinstance(given, bool):
        return float(given)
    if isinstance(like, str) and len(like) == 1 and isinstance(given, bool):
        return "Y" if given else "N"
    if type(given) is not type(like):
        raise ValueError(f"{name} is {given!r}, expected {type(like).__name__} such as {like!r}")
    return given


def unknown_names(given: Iterable[object], known: Collection[str]) -> str:
    """What is wrong with the names of parameters, and what may have been meant; empty if all are known or ROS's own."""
    unknown = sorted(str(name) for name in given if not (name in known or is_of_ros(str(name))))
    if not unknown:
        return ""
    near = [match for name in unknown for match in get_close_matches(name, known, n=1)]
    hint = f" (did you mean {', '.join(near)}?)" if near else ""
    return f"unknown parameter {', '.join(unknown)}{hint}; known: {', '.join(sorted(known))}"


def is_of_ros(name: str) -> bool:
    """Whether ROS itself has a parameter of this name for every node."""
    return name in ROS_NAMES or name.startswith("qos_overrides.")


NUMBER = r"-?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?"
INTERVAL = re.compile(rf"^({NUMBER})(?: to | <=? \w+ <=? )({NUMBER})")
LOWER_BOUND = re.compile(rf"(?:> |at least |above )({NUMBER})")
TOO_LARGE = {float: 1e300, int: 10**9}


@dataclasses.dataclass(frozen=True)
class ParameterDoc:
    """One parameter.

    Attributes:
        description: unit and meaning.
        allowed: what the dataclass says that it expects, in words; empty if it accepts anything.
        interval: lowest and highest value of a number; None where the dataclass names no bounds, infinity for one of them.
    """

    description: str
    allowed: str
    interval: tuple[float, float] | None


def parameter_docs(config: Any) -> dict[str, ParameterDoc]:
    """Every field of a dataclass of parameters; what is allowed may depend on the other values of `config`."""
    comments, docs = field_comments(type(config)), {}
    for field in dataclasses.fields(config):
        said = allowed(config, field.name)
        docs[field.name] = ParameterDoc(comments.get(field.name, ""), said, interval(said))
    return docs


def field_comments(kind: type[Any]) -> dict[str, str]:
    """Field name -> the comment on its line, of a dataclass and its bases; empty where no source is at hand."""
    found: dict[str, str] = {}
    for base in reversed(kind.__mro__):
        if dataclasses.is_dataclass(base):
            try:
                found |= _comments_of_class(inspect.getsource(base))
            except OSError:
                continue
    return found


def _comments_of_class(source: str) -> dict[str, str]:
    """Comments between the start of a field and the start of the next one."""
    found: dict[str, list[str]] = {}
    name = ""
    for token in tokenize.generate_tokens(io.StringIO(inspect.cleandoc(source)).readline):
        if token.type == tokenize.NAME and token.start[1] == 4:
            field = re.match(r"    (\w+) *:", token.line)
            name = field[1] if field else ""
        elif token.type == tokenize.COMMENT and name:
            found.setdefault(name, []).append(token.string.lstrip("# ").strip())
    return {field: " ".join(texts) for field, texts in found.items()}


def allowed(config: Any, name: str) -> str:
    """What a dataclass says it expects when this field is far out of range; empty if it accepts anything."""
    like = getattr(config, name)
    if isinstance(like, bool):
        return "true, false"
    wrong: tuple[object, ...]
    if isinstance(like, str):
        wrong = ("?",)
    elif isinstance(like, tuple):
        wrong = ((),)
    else:
        large = TOO_LARGE[type(like)]
        wrong = (large, -large)
    for value in wrong:
        try:
            dataclasses.replace(config, **{name: value})
        except (ValueError, OSError) as error:
            message = str(error)
            said = re.search(r"(?:expected|known:) (?:one of )?(.+)$", message)
            if said and message.startswith(name):
                return said[1].replace("a finite number, ", "").replace("a finite number ", "")
    return ""


def interval(said: str) -> tuple[float, float] | None:
    """Lowest and highest number of a text such as `0.05 to 0.5 m/s`, `> 0` or `at least 0`; None of any other."""
    if both := INTERVAL.match(said):
        return float(both[1]), float(both[2])
    if lower := LOWER_BOUND.match(said):
        return float(lower[1]), float("inf")
    return None
