# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Camera calibration files: what camera_info_manager, camera_calibration and OpenCV's FileStorage write.

The one reader of all packages: image_width, image_height, camera_matrix and distortion_coefficients as YAML, as OpenCV's
XML or JSON, or as the text ost.txt. OpenCV's files and ost.txt name no distortion model; it follows from the coefficients.
"""

from __future__ import annotations

import math
import os
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from fish_node.camera_document import WRONG, parse
from fish_node.file_head import packed_as
from fish_node.lens_check import (
    COEFFICIENTS,
    Fault,
    distortion_fault,
    matrix_fault,
    rectification_fault,
)

# OpenCV's rational model gives 14: behind the 8 those of a thin prism and a tilted sensor, zero unless they were asked for
LONGER = (8, 12, 14)
IDENTITY = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
# other names of a model: older camera_calibration wrote fisheye, and the equation is that of Kannala and Brandt
ALIASES = {
    "fisheye": "equidistant",
    "kannala_brandt": "equidistant",
    "kannala_brandt4": "equidistant",
}
LONGEST = 100  # characters of a foreign text in a message
NAMES = {  # field of sensor_msgs/CameraInfo -> that of a camera file
    "k": "camera_matrix",
    "d": "distortion_coefficients",
    "r": "rectification_matrix",
    "p": "projection_matrix",
}


class CameraFileError(ValueError):
    """A camera file that cannot be used; the message names file and field, and says what to change."""


@dataclass(frozen=True)
class CameraFile:
    """A calibrated camera in the terms of sensor_msgs/CameraInfo; matrices row by row, pixels."""

    width: int
    height: int
    model: str  # a key of COEFFICIENTS
    distortion: tuple[float, ...]  # as many as the model has
    camera_matrix: tuple[float, ...]  # (9,) K
    rectification: tuple[float, ...]  # (9,) R
    projection: tuple[float, ...]  # (12,) P


def read_camera_file(path: Path) -> CameraFile:
    """Read and check a camera file.

    Raises:
        CameraFileError: the file is no camera file, or a field is missing or impossible.
    """
    try:
        content = path.read_bytes()
        if said := packed_as(content):
            raise ValueError(said)
        document = parse(content.decode())
    except (OSError, *WRONG) as error:
        raise CameraFileError(
            f"{path}: no camera file: {_short(' '.join(str(error).split()))}"
        ) from error
    if not isinstance(document, dict):
        raise CameraFileError(
            f"{path}: no camera file: expected a mapping with camera_matrix, got {type(document).__name__}"
        )
    fields = _Fields(path, document)
    model, distortion = fields.distortion()
    K = fields.numbers("camera_matrix", (9,))
    fields.refuse(matrix_fault(K))
    size = fields.whole("image_width"), fields.whole("image_height")
    if not (0.0 < K[2] < size[0] and 0.0 < K[5] < size[1]):
        raise fields.wrong(
            "camera_matrix",
            f"has its centre at {K[2]:.4g}, {K[5]:.4g}",
            f"one inside the image of {size[0]} x {size[1]}; calibrate at the image size that is used",
        )
    fields.refuse(distortion_fault(size, model, K, distortion))
    plain = (*K[0:3], 0.0, *K[3:6], 0.0, *K[6:9], 0.0)
    R = fields.numbers("rectification_matrix", (9,), IDENTITY)
    P = fields.numbers("projection_matrix", (12,), plain)
    fields.refuse(rectification_fault(R, P))
    return CameraFile(*size, model, distortion, K, R, P)


def write_camera_file(path: Path, camera: CameraFile, name: str) -> None:
    """Write a camera file as camera_info_manager does; what was there stays if the camera cannot be read back.

    Args:
        path: of the file; its folder is made.
        camera: what is written.
        name: of the camera, as the file says it.

    Raises:
        CameraFileError: a field is impossible, or the file cannot be written; the message says which.
    """
    draft = path.with_name(f"{path.name}.new")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        draft.write_text(
            yaml.safe_dump(to_document(camera, name), sort_keys=False), encoding="utf-8"
        )
        read_camera_file(draft)
        os.replace(draft, path)
    except OSError as error:
        raise CameraFileError(
            f"{path}: cannot be written: {error.strerror or error}; give the node another calibration_file"
        ) from error
    finally:
        with suppress(OSError):
            draft.unlink(missing_ok=True)


def to_document(camera: CameraFile, name: str) -> dict[str, Any]:
    """The content of a camera file, as camera_info_manager writes it; name: of the camera."""
    return {
        "image_width": camera.width,
        "image_height": camera.height,
        "camera_name": name,
        "camera_matrix": _matrix(3, camera.camera_matrix),
        "distortion_model": camera.model,
        "distortion_coefficients": _matrix(1, camera.distortion),
        "rectification_matrix": _matrix(3, camera.rectification),
        "projection_matrix": _matrix(3, camera.projection),
    }


def _matrix(rows: int, values: tuple[float, ...]) -> dict[str, Any]:
    return {"rows": rows, "cols": len(values) // rows, "data": [float(value) for value in values]}


class _Fields:
    """Checked fields of one document."""

    def __init__(self, path: Path, document: dict[Any, Any]) -> None:
        self._path, self._document = path, document

    def wrong(self, name: str, what: str, expected: str) -> CameraFileError:
        return CameraFileError(f"{self._path}: {name} {what}, expected {expected}")

    def refuse(self, fault: Fault | None) -> None:
        """Raise what a check has found, if anything."""
        if fault is not None:
            raise self.wrong(NAMES[fault.field], fault.came, fault.expected)

    def absent(self, name: str) -> CameraFileError:
        held = ", ".join(map(str, list(self._document)[:12])) or "nothing"
        return CameraFileError(
            f"{self._path}: no {name}; it holds {_short(held)}; expected the names that camera_info_manager or"
            " camera_calibration writes"
        )

    def whole(self, name: str) -> int:
        if name not in self._document:
            raise self.absent(name)
        value = self._document[name]
        if (
            isinstance(value, bool)
            or not isinstance(value, int | float)
            or not 0 < value < 1e6
            or value % 1
        ):
            raise self.wrong(name, f"is {_short(repr(value))}", "a number of pixels")
        return int(value)

    def numbers(
        self, name: str, counts: tuple[int, ...], default: tuple[float, ...] | None = None
    ) -> tuple[float, ...]:
        if name not in self._document and default is not None:
            return default
        if name not in self._document:
            raise self.absent(name)
        matrix = self._document[name]
        data = matrix.get("data") if isinstance(matrix, dict) else matrix
        data = [] if data is None and counts[-1] == 0 and isinstance(matrix, dict) else data
        good = isinstance(data, list) and len(data) in counts and all(map(_is_number, data))
        if not good:
            expected = " or ".join(map(str, counts))
            raise self.wrong(
                f"{name}.data", f"is {_short(repr(data))}", f"{expected} finite numbers"
            )
        return tuple(float(value) for value in data)  # type: ignore[union-attr]

    def distortion(self) -> tuple[str, tuple[float, ...]]:
        """Model and coefficients."""
        name = "distortion_coefficients"
        model = self._document.get("distortion_model")
        if model is None:
            fisheye = bool(self._document.get("fisheye_model"))
            data = self.numbers(name, (4,) if fisheye else (5, 4, *LONGER, 0))
            model = "rational_polynomial" if len(data) in LONGER else "plumb_bob"
            model = "equidistant" if fisheye else model
        model = ALIASES.get(model, model) if isinstance(model, str) else model
        if not isinstance(model, str) or model not in COEFFICIENTS:
            known = ", ".join(COEFFICIENTS)
            raise self.wrong(
                "distortion_model",
                f"is {_short(repr(model))}",
                f"one of {known}; calibrate with one of these",
            )
        data = self.numbers(name, LONGER if model == "rational_polynomial" else COEFFICIENTS[model])
        if any(data[8:]):
            raise self.wrong(
                f"{name}.data",
                f"is {_short(str(list(data)))}",
                "zeros behind the first 8; calibrate without thin prism and tilted sensor",
            )
        data = data[:8]
        return model, (*data, *[0.0] * (COEFFICIENTS[model][0] - len(data)))


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _short(text: str) -> str:
    return text if len(text) <= LONGEST else text[:LONGEST] + " ..."
