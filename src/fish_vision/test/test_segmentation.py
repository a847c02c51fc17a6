# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Blobs of discs drawn here with exact antialiasing (many subpixels)."""

import cv2
import numpy as np
import pytest

from fish_vision.segmentation import ColourRange, around, find_blobs, hsv_of

RED = ColourRange(172, 12, 110, 80)
YELLOW = ColourRange(20, 36, 110, 90)
BGR = {"red": (35, 55, 240), "yellow": (0, 215, 255), "white": (255, 255, 255)}


def picture(
    discs: list[tuple[float, float, float, str]], ground: int = 55, noise: float = 0.0
) -> np.ndarray:
    """(40, 60, 3) grey picture with discs (u, v, radius, colour), 16 x 16 subpixels per pixel."""
    fine = 16
    u = (np.arange(60 * fine) + 0.5) / fine - 0.5
    v = (np.arange(40 * fine) + 0.5) / fine - 0.5
    result = np.full((40, 60, 3), float(ground))
    for u_0, v_0, radius, colour in discs:
        inside = ((u[None, :] - u_0) ** 2 + (v[:, None] - v_0) ** 2 < radius**2).astype(float)
        cover = inside.reshape(40, fine, 60, fine).mean(axis=(1, 3))[..., None]
        result = result * (1 - cover) + np.array(BGR[colour]) * cover
    result += np.random.default_rng(1).normal(0.0, noise, result.shape)
    return np.clip(np.round(result), 0, 255).astype(np.uint8)


def blobs(
    image: np.ndarray, colour: ColourRange, area: tuple[float, float] = (10.0, 300.0)
) -> list:
    return find_blobs(hsv_of(image, (0, 0, image.shape[1], image.shape[0])), colour, area)


@pytest.mark.parametrize("shift", [0.0, 0.23, 0.5, 0.81])
@pytest.mark.parametrize("radius", [2.5, 4.8])
def test_middle_is_found_far_finer_than_a_pixel(shift: float, radius: float) -> None:
    [blob] = blobs(picture([(30 + shift, 20 - shift, radius, "yellow")], noise=3.0), YELLOW)
    assert blob.u == pytest.approx(30 + shift, abs=0.07)
    assert blob.v == pytest.approx(20 - shift, abs=0.07)
    assert blob.area == pytest.approx(np.pi * radius**2, rel=0.15)


def test_hue_range_may_wrap_through_red() -> None:
    image = picture([(20, 20, 5, "red"), (45, 20, 5, "yellow")])
    [red] = blobs(image, RED)
    [yellow] = blobs(image, YELLOW)
    assert red.u == pytest.approx(20, abs=0.05)
    assert yellow.u == pytest.approx(45, abs=0.05)


def test_glare_has_no_colour() -> None:
    assert not blobs(picture([(20, 20, 6, "white")]), YELLOW)
    [blob] = blobs(picture([(30, 20, 5, "yellow"), (34, 20, 3, "white")]), YELLOW)
    assert blob.area < 0.8 * np.pi * 25  # the part under the glare is missing, not counted


def test_blobs_out_of_the_area_range_are_left_out_and_the_largest_is_first() -> None:
    image = picture([(8, 20, 1.2, "yellow"), (22, 20, 4, "yellow"), (42, 20, 5, "yellow")])
    assert [round(b.u) for b in blobs(image, YELLOW)] == [42, 22]
    assert not blobs(np.full((40, 60, 3), BGR["yellow"], np.uint8), YELLOW)


def test_a_blob_at_the_edge_is_measured_as_far_as_it_is_seen() -> None:
    [blob] = blobs(picture([(0, 20, 5, "yellow")]), YELLOW)
    assert 0.0 < blob.u < 4.0
    assert blob.v == pytest.approx(20, abs=0.05)


def test_pictures_of_noise_do_no_harm() -> None:
    noise = np.random.default_rng(2).integers(0, 256, (80, 80, 3)).astype(np.uint8)
    for colour in (RED, YELLOW):
        assert all(np.isfinite([b.u, b.v, b.area]).all() for b in blobs(noise, colour, (1.0, 1e4)))


def test_box_is_cut_at_the_image() -> None:
    assert around(np.array([[-5.0, 3.2], [20.0, 900.0]]), (100, 50)) == (0, 3, 21, 50)
    left, top, right, bottom = around(np.array([[200.0, 200.0], [210.0, 210.0]]), (100, 50))
    assert left >= right or top >= bottom


@pytest.mark.parametrize(
    ("colour", "expected"),
    [
        (YELLOW, range(12, 45)),
        (RED, [*range(164, 180), *range(21)]),
        (ColourRange(2, 10, 0, 0), [*range(19), *range(174, 180)]),
    ],
)
def test_hues_at_the_edge_of_a_blob_may_leave_the_range_by_a_little(
    colour: ColourRange, expected: list[int]
) -> None:
    near = colour.near(np.arange(180, dtype=np.uint8))
    assert set(np.flatnonzero(near)) == set(
        expected
    )  # 8 half degrees either side, round the circle


def test_mask_agrees_with_a_slow_comparison() -> None:
    hsv = cv2.cvtColor(
        np.random.default_rng(4).integers(0, 256, (30, 30, 3)).astype(np.uint8), cv2.COLOR_BGR2HSV
    )
    h, s, v = (hsv[..., i].astype(int) for i in range(3))
    expected = ((h >= 172) | (h <= 12)) & (s >= 110) & (v >= 80)
    np.testing.assert_array_equal(RED.mask(hsv) > 0, expected)
