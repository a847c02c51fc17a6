# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The text of a camera file as a mapping: YAML, JSON, OpenCV's XML, or the oST text of camera_calibration.

Names of fields become lower case: OpenCV's examples write Camera_Matrix and image_Width.
"""

from __future__ import annotations

import re
from typing import Any
from xml.etree import ElementTree

import yaml

YAML_LINE = "%YAML:1.0"  # OpenCV's first line, which is no YAML 1.1 directive
# headings of the oST text and the names of their numbers
OST = {
    "width": "image_width",
    "height": "image_height",
    "camera matrix": "camera_matrix",
    "distortion": "distortion_coefficients",
    "rectification": "rectification_matrix",
    "projection": "projection_matrix",
}
FISHEYE = 4  # coefficients; camera_calibration writes 5 or 8 for other lenses
WRONG = (yaml.YAMLError, ElementTree.ParseError, ValueError, RecursionError)  # what parsing raises


class _Loader(yaml.SafeLoader):  # type: ignore[misc]
    """YAML with OpenCV's tagged matrices."""


def _unique(loader: _Loader, node: yaml.MappingNode) -> dict[Any, Any]:
    """A mapping; of two entries of one name, which YAML forbids, neither is chosen."""
    names = [key.value for key, _ in node.value if isinstance(key, yaml.ScalarNode)]
    twice = [name for name in dict.fromkeys(names) if names.count(name) > 1]
    if twice:
        raise ValueError(f"{twice[0]} is given twice; keep one of the two")
    return dict(loader.construct_mapping(node, deep=True))


def _matrix(loader: _Loader, node: yaml.MappingNode) -> dict[Any, Any]:
    return _unique(loader, node)


_Loader.add_constructor(yaml.resolver.BaseResolver.DEFAULT_MAPPING_TAG, _unique)
_Loader.add_constructor("tag:yaml.org,2002:opencv-matrix", _matrix)
_Loader.add_implicit_resolver(  # 1e-05, as C++ writes it: a number in YAML 1.2, a text in 1.1
    "tag:yaml.org,2002:float",
    re.compile(r"[-+]?[0-9]+(\.[0-9]*)?[eE][-+]?[0-9]+"),
    list("-+0123456789"),
)


def parse(text: str) -> object:
    """What a camera file says, in whatever form: a mapping of lower-case names where it is one.

    Raises:
        one of WRONG: the text is nothing of the kind.
    """
    start = text.lstrip("\ufeff \t\r\n")
    if start.startswith("<"):
        document: object = _xml(start)
    elif re.match(r"(#[^\n]*\n|\s)*\[image\]", start):
        document = _ost(start)
    else:
        document = yaml.load(start.removeprefix(YAML_LINE), Loader=_Loader)
    if not isinstance(document, dict):
        return document
    return {str(name).lower(): value for name, value in document.items()}


def _xml(text: str) -> dict[str, Any]:
    """OpenCV's FileStorage: a matrix has rows, cols and data, anything else is a number or a text."""
    if "<!ENTITY" in text:
        raise ValueError("an XML file with entities is not read")
    document: dict[str, Any] = {}
    for entry in ElementTree.fromstring(text):
        data = entry.find("data")
        if data is None:
            document[entry.tag] = _value(entry.text or "")
        else:
            document[entry.tag] = {"data": [float(word) for word in (data.text or "").split()]}
    return document


def _ost(text: str) -> dict[str, Any]:
    """camera_calibration's ost.txt: a heading, then its numbers, until the next heading."""
    numbers: dict[str, list[float]] = {}
    heading = ""
    for line in map(str.strip, text.splitlines()):
        if line in OST:
            heading = OST[line]
            if heading in numbers:
                raise ValueError(
                    f"two cameras: {line!r} stands in it twice; give each camera a file of its own"
                )
            numbers[heading] = []
        elif line.startswith(("#", "[")):
            heading = ""
        elif heading and line:
            numbers[heading] += [float(word) for word in line.split()]
    if len(numbers.get(OST["distortion"], ())) == FISHEYE:
        raise ValueError(
            f"{FISHEYE} numbers of distortion, a fisheye's: this format names no model; use the ost.yaml beside it"
        )
    single = {
        name: values[0] for name, values in numbers.items() if name.startswith("image_") and values
    }
    return {**{name: {"data": values} for name, values in numbers.items()}, **single}


def _value(text: str) -> float | str:
    """A number where the text is one; OpenCV puts texts in quotes."""
    try:
        return float(text)
    except ValueError:
        return text.strip().strip('"')
