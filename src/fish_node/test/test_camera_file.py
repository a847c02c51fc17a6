# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Camera files of all writers."""

import gzip

import cv2
import numpy as np
import pytest
import yaml

from fish_node.camera_file import CameraFileError, read_camera_file, write_camera_file

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
RATIONAL = [0.2, 0.03, 0.001, -0.002, 0.01, 0.3, 0.06, 0.02]


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
        ("rational_polynomial", RATIONAL, tuple(RATIONAL)),
        ("rational_polynomial", RATIONAL + [0.0] * 6, tuple(RATIONAL)),
        ("equidistant", [0.05, 0.04, -0.02, 0.004], (0.05, 0.04, -0.02, 0.004)),
    ],
)
def test_every_model_is_read(tmp_path, model, data, expected):
    camera = read_camera_file(written(tmp_path, changed(model, data)))
    assert (camera.model, camera.distortion) == (model, expected)
    assert (camera.width, camera.height, camera.camera_matrix) == (800, 600, tuple(K))
    assert camera.projection[0] == 500.0


@pytest.mark.parametrize("name", ["fisheye", "kannala_brandt4"])
def test_other_names_of_a_fisheye_are_taken(tmp_path, name):
    camera = read_camera_file(written(tmp_path, changed(name, [0.05, 0.04, -0.02, 0.004])))
    assert (camera.model, camera.distortion[0]) == ("equidistant", 0.05)


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
        ({"camera_matrix": {"data": [K[0], 5.0, *K[2:]]}}, "expected fx 0 cx"),
        ({"distortion_model": "fancy"}, "distortion_model is 'fancy', expected one of plumb_bob"),
        ({"distortion_coefficients": {"data": [0.1] * 3}}, "expected 5 or 4 or 0 finite numbers"),
        ({"distortion_coefficients": {"data": [float("nan")] * 5}}, "finite numbers"),
        ({"projection_matrix": {"data": "x" * 500}}, "expected 12 finite numbers"),
        *(
            (changed(model, data), r"distortion_coefficients is \[.* of its own; calibrate")
            for model, data in (
                ("plumb_bob", [-0.9, 0.0, 0.0, 0.0]),
                ("plumb_bob", [1e300] * 5),
                ("plumb_bob", [0.0, 0.0, 1e3, 0.0]),
                ("equidistant", [-5.0, 0.0, 0.0, 0.0]),
            )
        ),
        *(
            (changed(model, data), "at most 2 times as far out")
            for model, data in (
                ("plumb_bob", [100.0, 0.0, 0.0, 0.0]),
                ("plumb_bob", [0.0, 0.0, 0.0, 0.0, 1e4]),
                ("rational_polynomial", [0.0] * 5 + [-5.0, 0.0, 0.0]),
            )
        ),
        (
            {"camera_matrix": {"data": [1e300, *K[1:4], 1.0, *K[5:]]}},
            r"focal lengths 1e\+300, 1, expected less than 1e\+06 pixels",
        ),
        (
            {"camera_matrix": {"data": [*K[:4], 3.0, *K[5:]]}},
            "538.6, 3, expected two of which none",
        ),
        ({"rectification_matrix": {"data": [0.0] * 9}}, "expected a rotation"),
        ({"projection_matrix": {"data": [0.0] * 12}}, "projection_matrix has focal lengths 0, 0"),
        (
            {"projection_matrix": {"data": [*K[:3], 0.0, *K[3:6], 0.0, 5.0, 5.0, 0.0, 0.0]}},
            r"last row \[5, 5, 0, 0\], expected 0 0 1 0",
        ),
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


@pytest.mark.parametrize("missing", ["image_width", "camera_matrix", "distortion_coefficients"])
def test_a_missing_field_is_named_with_those_that_are_there(tmp_path, missing):
    document = {name: value for name, value in FILE.items() if name != missing}
    with pytest.raises(CameraFileError, match=f"no {missing}; it holds .*camera_name"):
        read_camera_file(written(tmp_path, document))


def test_a_field_that_is_given_twice_is_refused(tmp_path):
    text = yaml.safe_dump(FILE) + "image_width: 640\n"
    with pytest.raises(CameraFileError, match="image_width is given twice"):
        read_camera_file(written(tmp_path, text))


def test_a_packed_file_is_named(tmp_path):
    path = tmp_path / "camera.yml.gz"
    path.write_bytes(gzip.compress(yaml.safe_dump(FILE).encode()))
    with pytest.raises(CameraFileError, match="compressed by gzip; gunzip it"):
        read_camera_file(path)


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(CameraFileError, match="No such file"):
        read_camera_file(tmp_path / "nowhere.yaml")


OST = """# oST version 5.0 parameters


[image]

width
640

height
480

[narrow_stereo]

camera matrix
538.630000 0.000000 310.500000
0.000000 539.720000 240.250000
0.000000 0.000000 1.000000

distortion
-0.300000 0.080000 0.002000 -0.000100 0.000000

rectification
1.000000 0.000000 0.000000
0.000000 1.000000 0.000000
0.000000 0.000000 1.000000

projection
500.000000 0.000000 312.000000 0.000000
0.000000 510.000000 241.000000 0.000000
0.000000 0.000000 1.000000 0.000000
"""


def test_the_text_of_camera_calibration_is_read(tmp_path):
    path = tmp_path / "ost.txt"
    path.write_text(OST)
    camera = read_camera_file(path)
    assert (camera.width, camera.height, camera.model) == (640, 480, "plumb_bob")
    assert camera.camera_matrix == (538.63, 0.0, 310.5, 0.0, 539.72, 240.25, 0.0, 0.0, 1.0)
    assert camera.distortion == (-0.3, 0.08, 0.002, -0.0001, 0.0)
    assert camera.projection[:4] == (500.0, 0.0, 312.0, 0.0)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (OST + OST.replace("narrow_stereo", "narrow_stereo/right"), "two cameras"),
        (
            OST.replace(" -0.000100 0.000000", " -0.000100"),
            "a fisheye's: .* use the ost.yaml beside it",
        ),
    ],
    ids=["stereo", "fisheye"],
)
def test_a_text_that_leaves_the_camera_open_is_refused(tmp_path, text, said):
    with pytest.raises(CameraFileError, match=said):
        read_camera_file(written(tmp_path, text))


@pytest.mark.parametrize("suffix", [".xml", ".json", ".yaml"])
@pytest.mark.parametrize("capitals", [False, True])
def test_every_form_of_opencv_s_storage_is_read(tmp_path, suffix, capitals):
    """Names with capitals are those of OpenCV's own calibration example."""
    names = (
        ("image_Width", "image_Height", "Camera_Matrix", "Distortion_Coefficients")
        if capitals
        else ("image_width", "image_height", "camera_matrix", "distortion_coefficients")
    )
    path = tmp_path / f"camera{suffix}"
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    storage.write("calibration_Time", "Fri Nov 27 10:00:00 2026")
    matrices = np.array(K, float).reshape(3, 3), np.array([[-0.3, 0.08, 0.002, -0.0001, 0.05]]).T
    for name, value in zip(names, (800, 600, *matrices), strict=True):
        storage.write(name, value)
    storage.release()
    camera = read_camera_file(path)
    assert (camera.width, camera.height, camera.model) == (800, 600, "plumb_bob")
    assert camera.camera_matrix == pytest.approx(K)
    assert camera.distortion == pytest.approx((-0.3, 0.08, 0.002, -0.0001, 0.05))


@pytest.mark.parametrize(
    "text",
    [
        "<opencv_storage><camera_matrix>",
        "<!DOCTYPE x [<!ENTITY a 'b'>]><opencv_storage/>",
        "<opencv_storage><camera_matrix><data>1 2 x</data></camera_matrix></opencv_storage>",
        "[image]\n\nwidth\nwide\n",
    ],
)
def test_a_broken_file_of_any_form_is_one_line(tmp_path, text):
    with pytest.raises(CameraFileError, match="no camera file") as refusal:
        read_camera_file(written(tmp_path, text))
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize("small", ["1e-05", "1E-5", "-1e-05", "+1e-5", "1.e-05"])
def test_numbers_as_c_writes_them(tmp_path, small):
    text = yaml.safe_dump(FILE).replace("0.002", small)
    assert read_camera_file(written(tmp_path, text)).distortion[2] == float(small)


@pytest.mark.parametrize(
    ("matrix", "said"),
    [
        ([538.63, 0, 0, 0, 539.723, 0, 457.698, 297.003, 1], "expected fx 0 cx, 0 fy cy, 0 0 1"),
        ([538.63, 0, 457.698, 0, 539.723, 297.003, 0, 0, 2], "0 0 1 row by row"),
        ([1077.26, 0, 915.396, 0, 1079.446, 594.006, 0, 0, 1], "inside the image of 800 x 600"),
        ([538.63, 0, 457.698, 0, 539.723, -297.003, 0, 0, 1], "inside the image"),
    ],
    ids=["column by column", "scaled", "of a larger image", "mirrored"],
)
def test_a_matrix_that_is_none_of_this_camera(tmp_path, matrix, said):
    file = FILE | {"camera_matrix": {"rows": 3, "cols": 3, "data": matrix}}
    with pytest.raises(CameraFileError, match=said):
        read_camera_file(written(tmp_path, file))


def test_a_pointer_in_place_of_the_file_is_named(tmp_path):
    text = "version https://git-lfs.github.com/spec/v1\noid sha256:aa\nsize 130\n"
    with pytest.raises(CameraFileError, match="Git LFS pointer"):
        read_camera_file(written(tmp_path, text))


@pytest.mark.parametrize("model", ["rational_polynomial", None])
@pytest.mark.parametrize("count", [12, 14])
def test_the_rational_model_of_opencv_has_more_coefficients_which_are_zero(tmp_path, model, count):
    """calibrateCamera with CALIB_RATIONAL_MODEL returns 14; a thin prism is another model."""
    document = changed("rational_polynomial", RATIONAL + [0.0] * (count - 8))
    if model is None:
        del document["distortion_model"]
    camera = read_camera_file(written(tmp_path, document))
    assert (camera.model, camera.distortion) == ("rational_polynomial", tuple(RATIONAL))
    document["distortion_coefficients"]["data"][-1] = 0.01
    with pytest.raises(CameraFileError, match="thin prism"):
        read_camera_file(written(tmp_path, document))


def test_a_folder_that_is_a_file_is_named_as_the_reason(tmp_path):
    camera = read_camera_file(written(tmp_path, changed("plumb_bob", [0.0] * 5)))
    (tmp_path / "file").write_text("")
    with pytest.raises(CameraFileError, match=r"cannot be written: .*another calibration_file"):
        write_camera_file(tmp_path / "file" / "camera.yaml", camera, "camera")
