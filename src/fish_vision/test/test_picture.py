# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Message bytes to pictures, and what is said of bytes that are none."""

import cv2
import numpy as np
import pytest

from fish_vision.picture import PictureError, from_compressed, from_raw, to_jpeg

SIZE = (32, 24)
PICTURE = cv2.GaussianBlur(
    np.random.default_rng(0).integers(0, 256, (24, 32, 3)).astype(np.uint8), (5, 5), 2
)


def test_jpeg_goes_there_and_back() -> None:
    assert cv2.PSNR(from_compressed(to_jpeg(PICTURE, 95), SIZE), PICTURE) > 25.0


@pytest.mark.parametrize(
    ("encoding", "channels"),
    [("bgr8", [0, 1, 2]), ("rgb8", [2, 1, 0]), ("bgra8", [0, 1, 2, 0]), ("rgba8", [2, 1, 0, 0])],
)
def test_raw_encodings_and_padded_rows(encoding: str, channels: list[int]) -> None:
    step = 32 * len(channels) + 8
    rows = np.zeros((24, step), np.uint8)
    rows[:, : 32 * len(channels)] = PICTURE[..., channels].reshape(24, -1)
    np.testing.assert_array_equal(from_raw(rows.tobytes(), encoding, 32, 24, step, SIZE), PICTURE)


def test_yuyv_grey_is_grey() -> None:
    data = np.tile(np.array([120, 128], np.uint8), 32 * 24).tobytes()
    picture = from_raw(data, "yuv422_yuy2", 32, 24, 64, SIZE)
    assert picture.shape == (24, 32, 3)
    assert np.ptp(picture) <= 1


def test_yuyv_keeps_its_colours() -> None:
    """Studio-range BT.601, bytes Y U Y V: swapped U and V would make red blue."""
    red, blue = bytes([82, 90, 82, 240]), bytes([41, 240, 41, 110])
    picture = from_raw(red * 16 + blue * 16, "yuv422_yuy2", 64, 1, 128, (64, 1)).astype(int)
    assert np.abs(picture[0, :32] - (0, 0, 255)).max() < 8
    assert np.abs(picture[0, 32:] - (255, 0, 0)).max() < 8


def test_odd_width_is_refused_only_where_two_pixels_share_a_colour() -> None:
    odd = PICTURE[:, :31]
    np.testing.assert_array_equal(from_raw(odd.tobytes(), "bgr8", 31, 24, 93, (31, 24)), odd)
    with pytest.raises(PictureError, match="width 17: expected an even one"):
        from_raw(bytes(34 * 4), "yuv422_yuy2", 17, 4, 34, (17, 4))


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"", "0 bytes"),
        (b"hello", "no JPEG"),
        (to_jpeg(PICTURE)[:400], "cut off"),
        (b"\xff\xd8" + bytes(500) + b"\xff\xd9", "broken"),
    ],
)
def test_broken_jpeg_is_refused_with_the_reason(data: bytes, message: str) -> None:
    with pytest.raises(PictureError, match=message):
        from_compressed(data, SIZE)


def test_a_padded_jpeg_is_taken_and_an_early_end_marker_hides_no_cut() -> None:
    data = to_jpeg(PICTURE)
    np.testing.assert_array_equal(
        from_compressed(data + bytes(60), SIZE), from_compressed(data, SIZE)
    )
    with_thumbnail = data[:100] + b"\xff\xd9" + data[100:300]
    with pytest.raises(PictureError, match="cut off after 302 bytes"):
        from_compressed(with_thumbnail, SIZE)


def test_a_picture_of_another_size_is_refused() -> None:
    with pytest.raises(PictureError, match="32 x 24, but camera_info says 64 x 48"):
        from_compressed(to_jpeg(PICTURE), (64, 48))


@pytest.mark.parametrize(
    ("encoding", "width", "step", "message"),
    [
        ("mono8", 32, 32, "mono8"),
        ("bgr8", 32, 90, "rows of 90"),
        ("bgr8", 40, 120, "bytes"),
        ("bgr8", 0, 0, "0 x 24"),
    ],
)
def test_raw_images_that_do_not_add_up_are_refused(
    encoding: str, width: int, step: int, message: str
) -> None:
    with pytest.raises(PictureError, match=message):
        from_raw(PICTURE.tobytes(), encoding, width, 24, step, SIZE)
