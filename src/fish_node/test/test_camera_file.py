# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Camera files of all writers."""

import cv2
import numpy as np
import pytest
import yaml

from fish_node.camera_file import CameraFileError, read_camera_file

K = [538.63, 0, 457.698, 0, 539.723, 297.003, 0, 0, 1]
FILE = {
    "image_width": 800,
    "image_height": 600,
    "camera_name": "cam",
    "camera_matrix": {"rows": 3, "cols": 3, "data": K},
    "distortion_model": "plumb_bob",
    "distortion_coefficients": {"rows": 1, "cols": 5, "data": [-0.3, 0.08, 0.002, -0.0001, 0]},
    "rectification_matrix": {"rows": 3, "cols": 3, "data": [1, 0, 0, 0, 1, 0, 0, 0, 1]},
    "projection_matrix": {
        "rows": 3,
        "cols": 4,
        "data": [500, 0, 450, 0, 0, 510, 290, 0, 0, 0, 1, 0],
    },
}


def written(tmp_path, content):
    path = tmp_path / "camera.yaml"
    path.write_text(content if isinstance(content, str) else yaml.safe_dump(content))
    return path


def changed(model, data):
    return FILE | {"distortion_model": model, "distortion_coefficients": {"data": data}}


@pytest.mark.parametrize(
    ("model", "data", "expected"),
    [
        ("plumb_bob", [-0.3, 0.1, 0.0, 0.0], (-0.3, 0.1, 0.0, 0.0, 0.0)),
        ("plumb_bob", [-0.3, 0.1, 0.0, 0.0, 0.2], (-0.3, 0.1, 0.0, 0.0, 0.2)),
        ("plumb_bob", [], (0.0,) * 5),
        ("rational_polynomial", [0.1] * 8, (0.1,) * 8),
        ("equidistant", [0.05, 0.04, -0.02, 0.004], (0.05, 0.04, -0.02, 0.004)),
    ],
)
def test_every_model_is_read(tmp_path, model, data, expected):
    camera = read_camera_file(written(tmp_path, changed(model, data)))
    assert (camera.model, camera.distortion) == (model, expected)
    assert (camera.width, camera.height, camera.camera_matrix) == (800, 600, tuple(K))
    assert camera.projection[0] == 500.0


@pytest.mark.parametrize("head", ["%YAML:1.0\n", "%YAML:1.0\n---\n"])
def test_the_first_line_of_opencv_is_taken(tmp_path, head):
    assert read_camera_file(written(tmp_path, head + yaml.safe_dump(FILE))).width == 800


@pytest.mark.parametrize("count", [4, 5, 8])
def test_what_file_storage_writes_is_taken(tmp_path, count):
    path = tmp_path / "opencv.yml"
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    storage.write("image_width", 800)
    storage.write("image_height", 600)
    storage.write("camera_matrix", np.reshape(K, (3, 3)))
    storage.write("distortion_coefficients", np.full((1, count), 0.01))
    storage.release()
    camera = read_camera_file(path)
    assert camera.camera_matrix == tuple(K)
    assert camera.distortion[:count] == (0.01,) * count
    assert camera.projection[:4] == (*K[:3], 0.0)


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ({"image_width": "wide"}, "image_width is 'wide', expected a number of pixels"),
        ({"image_height": True}, "image_height is True, expected a number of pixels"),
        ({"camera_matrix": {"data": [1, 2]}}, r"camera_matrix.data is \[1, 2\], expected 9 finite"),
        ({"camera_matrix": 3}, "camera_matrix.data is 3, expected 9 finite numbers"),
        ({"camera_matrix": {"data": [0.0] * 9}}, "focal lengths 0, 0"),
        ({"distortion_model": "fancy"}, "distortion_model is 'fancy', expected one of plumb_bob"),
        ({"distortion_coefficients": {"data": [0.1] * 3}}, "expected 5 or 4 or 0 finite numbers"),
        ({"distortion_coefficients": {"data": [float("nan")] * 5}}, "finite numbers"),
        ({"projection_matrix": {"data": "x" * 500}}, "expected 12 finite numbers"),
    ],
)
def test_errors_name_file_and_field_in_one_short_line(tmp_path, change, expected):
    with pytest.raises(CameraFileError, match=expected) as caught:
        read_camera_file(written(tmp_path, FILE | change))
    assert "camera.yaml" in str(caught.value)
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 400


@pytest.mark.parametrize("text", ["", "[1, 2]", "{bad: [", "a: b: c", "\x00", "!!python/none x"])
def test_files_that_are_no_camera_file(tmp_path, text):
    with pytest.raises(CameraFileError, match="no camera file"):
        read_camera_file(written(tmp_path, text))


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(CameraFileError, match="No such file"):
        read_camera_file(tmp_path / "nowhere.yaml")
