# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What a dataclass of parameters says of itself: units and meaning beside its fields, ranges in its refusals.

The nodes' parameter descriptors and the reference page of the documentation are both made from this. No ROS.
"""

from __future__ import annotations

import dataclasses
import inspect
import io
import re
import tokenize
from typing import Any

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
    """Field name -> the comment beside its definition, of a dataclass and its bases; empty where no source is at hand."""
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
