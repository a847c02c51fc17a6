"""The YAML that camera_calibration and usb_cam write: read and checked."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

SIZES = {"camera_matrix": 9, "rectification_matrix": 9, "projection_matrix": 12}
DISTORTION_SIZES = {"plumb_bob": 5, "rational_polynomial": 8, "equidistant": 4}


class CalibrationError(Exception):
    """A calibration file that cannot be used; the message names file, field and what was expected."""


@dataclass(frozen=True)
class CameraCalibration:
    """Intrinsics in px, row-major: K (9), distortion, R (9), P (12)."""

    width: int
    height: int
    distortion_model: str
    distortion: tuple[float, ...]
    camera_matrix: tuple[float, ...]
    rectification: tuple[float, ...]
    projection: tuple[float, ...]


def read_calibration(path: Path) -> CameraCalibration:
    """Read a calibration file; CalibrationError says what is wrong with it."""
    try:
        document = yaml.safe_load(path.read_text())
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
        raise CalibrationError(f"calibration {path}: {' '.join(str(error).split())}") from error
    if not isinstance(document, dict):
        raise CalibrationError(
            f"calibration {path}: expected a YAML mapping, got {type(document).__name__}"
        )
    model = str(_field(document, "distortion_model", path))
    if model not in DISTORTION_SIZES:
        known = ", ".join(DISTORTION_SIZES)
        raise CalibrationError(
            f"calibration {path}: distortion_model is {model!r}, expected one of {known}"
        )
    return CameraCalibration(
        width=_whole(document, "image_width", path),
        height=_whole(document, "image_height", path),
        distortion_model=model,
        distortion=_numbers(document, "distortion_coefficients", DISTORTION_SIZES[model], path),
        camera_matrix=_numbers(document, "camera_matrix", SIZES["camera_matrix"], path),
        rectification=_numbers(
            document, "rectification_matrix", SIZES["rectification_matrix"], path
        ),
        projection=_numbers(document, "projection_matrix", SIZES["projection_matrix"], path),
    )


def _field(document: dict[str, Any], name: str, path: Path) -> Any:
    if name not in document:
        raise CalibrationError(f"calibration {path}: {name} is missing")
    return document[name]


def _whole(document: dict[str, Any], name: str, path: Path) -> int:
    value = _field(document, name, path)
    if not isinstance(value, int) or value <= 0:
        raise CalibrationError(
            f"calibration {path}: {name} is {value!r}, expected a number of pixels"
        )
    return value


def _numbers(document: dict[str, Any], name: str, count: int, path: Path) -> tuple[float, ...]:
    matrix = _field(document, name, path)
    data = matrix.get("data") if isinstance(matrix, dict) else None
    if (
        not isinstance(data, list)
        or len(data) != count
        or not all(isinstance(v, int | float) for v in data)
    ):
        raise CalibrationError(
            f"calibration {path}: {name}.data is {data!r}, expected {count} numbers"
        )
    return tuple(float(value) for value in data)
