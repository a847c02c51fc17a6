# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The pool's outline found in drawn pictures: accuracy in several lights and lenses, and what must be refused."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import cv2
import numpy as np
import pytest

from fish_vision.calibration import CalibrationError, Lens, Mount, project
from fish_vision.pool_outline import find_pool

SIDES = (4.27, 2.13)
MOUNT = Mount((0.06, -0.09, 3.2), (-0.03, 0.025, 0.02))
WEBCAM = Lens.from_camera_info(
    960,
    540,
    "plumb_bob",
    [750.0, 0, 474, 0, 750.0, 275, 0, 0, 1],
    [-0.26, 0.07, 0.0008, -0.0005, 0],
)
FISHEYE = Lens.from_camera_info(
    960, 720, "equidistant", [420.0, 0, 484, 0, 420.0, 352, 0, 0, 1], [0.02, -0.01, 0.003, 0.0]
)
DECK, TOP, WALL, FLOOR, GROUT = (
    (112, 116, 118),
    (205, 205, 200),
    (126, 105, 53),
    (196, 172, 96),
    (172, 148, 78),
)
FINE = 3  # subpixels of a pixel in each direction
APPARENT_DEPTH = 0.45  # m, at which refraction shows the floor

Thing = tuple[float, float, float, float, tuple[int, int, int]]  # middle, sides, m, colour


@dataclass(frozen=True)
class View:
    """What is before the camera."""

    lens: Lens = WEBCAM
    mount: Mount = MOUNT
    pools: Sequence[tuple[float, float]] = ((0.0, 0.0),)  # middles, m
    clutter: Sequence[Thing] = ()
    light: tuple[float, float, float] = (1.0, 1.0, 1.0)  # gains of blue, green, red
    shade: float = 0.0  # share of light that is lost from the left to the right edge
    noise: float = 3.0
    rim: float = 0.05  # m
    tiles: bool = True
    sides: tuple[float, float] = field(default=SIDES)


def picture(view: View) -> np.ndarray:
    """A pool with a rim, walls and a tiled floor, things on the deck and over the rim, light and noise."""
    width, height = view.lens.size
    canvas = np.empty((height * FINE, width * FINE, 3), np.uint8)
    canvas[:] = DECK

    def fill(
        x: float,
        y: float,
        length: float,
        breadth: float,
        colour: tuple[int, int, int],
        z: float = 0.0,
    ) -> None:
        corners = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) * np.array([length, breadth]) / 2
        share = np.linspace(0, 1, 30, endpoint=False)[:, None]
        ends = np.roll(corners, -1, axis=0)
        line = np.vstack([a + share * (b - a) for a, b in zip(corners, ends, strict=True)]) + [x, y]
        solid = np.column_stack([line, np.full(len(line), z)])
        R = view.mount.R
        pixels = project(solid, cv2.Rodrigues(R)[0], -R @ np.array(view.mount.position), view.lens)
        fine = np.round(((pixels + 0.5) * FINE - 0.5) * 16).astype(np.int32)
        cv2.fillPoly(canvas, [fine], colour, shift=4)

    length, breadth = view.sides
    for x, y in view.pools:
        fill(x, y, length + 2 * view.rim, breadth + 2 * view.rim, TOP)
        fill(x, y, length, breadth, WALL)
        fill(x, y, length, breadth, FLOOR, -APPARENT_DEPTH)
        for line in np.arange(-length / 2, length / 2, 0.305) if view.tiles else ():
            fill(x + line, y, 0.012, breadth, GROUT, -APPARENT_DEPTH)
        for line in np.arange(-breadth / 2, breadth / 2, 0.305) if view.tiles else ():
            fill(x, y + line, length, 0.012, GROUT, -APPARENT_DEPTH)
    for x, y, length, breadth, colour in view.clutter:
        fill(x, y, length, breadth, colour)
    seen = cv2.resize(canvas, view.lens.size, interpolation=cv2.INTER_AREA).astype(float)
    seen *= np.array(view.light) * (1.0 - view.shade * np.linspace(0, 1, width)[:, None])
    seen += np.random.default_rng(1).normal(0.0, view.noise, seen.shape)
    return np.clip(np.round(seen), 0, 255).astype(np.uint8)


CLUTTER: tuple[Thing, ...] = (
    (-2.3, 1.0, 0.3, 0.5, (40, 60, 180)),  # over a corner
    (0.8, 1.05, 1.3, 0.25, (60, 60, 60)),  # over a third of a side
    (1.2, -0.3, 0.4, 0.4, (30, 200, 220)),  # in the water
    (-0.5, 1.28, 0.9, 0.12, (230, 230, 230)),  # on the deck
    (0.2, -1.2, 0.06, 0.5, (220, 220, 220)),  # a ladder
)


@pytest.mark.parametrize(
    ("view", "millimetres"),
    [
        (View(), 2.0),
        (View(light=(0.3, 0.3, 0.3)), 3.0),
        (View(light=(0.6, 0.95, 1.2)), 2.0),
        (View(light=(1.3, 1.1, 0.9)), 2.0),
        (View(shade=0.7), 3.0),
        (View(noise=10.0), 4.0),
        (View(clutter=CLUTTER), 3.0),
        (View(lens=FISHEYE), 4.0),
        (View(lens=FISHEYE, clutter=CLUTTER, shade=0.5), 5.0),
        (View(mount=Mount((0.5, -0.6, 3.4), (-0.15, 0.1, 0.05))), 4.0),
        (View(rim=0.02), 2.0),
    ],
    ids=[
        "plain",
        "dark",
        "warm",
        "bright",
        "shade",
        "noise",
        "clutter",
        "fisheye",
        "fisheye_clutter",
        "tilted",
        "thin_rim",
    ],
)
def test_the_outline_gives_the_camera_in_any_light_and_lens(view: View, millimetres: float) -> None:
    """Errors are those of the corners as the camera found would place them on the water."""
    found = find_pool(picture(view), view.lens, SIDES, 0.0, "right")
    corners = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) * np.array(SIDES) / 2
    solid = np.column_stack([corners, np.zeros(4)])
    R, R_found = view.mount.R, found.mount.R
    true = project(solid, cv2.Rodrigues(R)[0], -R @ np.array(view.mount.position), view.lens)
    seen = project(
        solid, cv2.Rodrigues(R_found)[0], -R_found @ np.array(found.mount.position), view.lens
    )
    each_pixel = 1e3 * view.mount.position[2] / view.lens.K[0, 0]  # mm
    assert np.abs(seen - true).max() * each_pixel < millimetres
    assert found.rms < 0.6
    assert np.abs(found.mount.position - np.array(view.mount.position)).max() < 0.02


def test_hidden_parts_of_a_side_are_reported() -> None:
    found = find_pool(picture(View(clutter=CLUTTER)), WEBCAM, SIDES, 0.0, "right")
    above, left, below, right = found.seen  # +y, -x, -y, +x
    assert 0.5 < above < 0.8
    assert 0.6 < left <= 1.0
    assert min(below, right) > 0.9


@pytest.mark.parametrize(("x_points", "turn"), [("right", 0.0), ("left", np.pi)])
def test_x_points_says_which_way_round_the_pool_is(x_points: str, turn: float) -> None:
    found = find_pool(picture(View()), WEBCAM, SIDES, 0.0, x_points)
    ahead = found.mount.R @ [1.0, 0.0, 0.0]
    assert (
        np.arctan2(-ahead[1], ahead[0]) % (2 * np.pi) == pytest.approx(turn, abs=0.05)
        or turn == 0.0
    )
    assert np.sign(ahead[0]) == np.cos(turn)


def test_the_outline_may_lie_above_the_water() -> None:
    found = find_pool(picture(View()), WEBCAM, SIDES, 0.1, "right")
    assert found.mount.position[2] == pytest.approx(MOUNT.position[2] + 0.1, abs=5e-3)


@pytest.mark.parametrize(
    ("view", "sides", "x_points", "message"),
    [
        (View(pools=()), SIDES, "right", "no rectangle of 4.27 x 2.13 m"),
        (View(pools=((1.4, 0.0),)), SIDES, "right", "no rectangle of 4.27 x 2.13 m"),
        (View(), (5.0, 2.13), "right", "no rectangle of 5 x 2.13 m"),
        (View(clutter=((0.0, 1.05, 4.5, 0.4, (60, 60, 60)),)), SIDES, "right", "no rectangle of"),
        (View(light=(0.02, 0.02, 0.02)), SIDES, "right", "no rectangle of"),
        (
            View(
                pools=((0.0, 1.3), (0.0, -1.3)),
                tiles=False,
                mount=Mount((0.0, 0.0, 7.5), (0.0, 0.0, 0.0)),
            ),
            SIDES,
            "right",
            "more than one rectangle",
        ),
        (View(), SIDES, "up", "degrees off --x-points up one way or the other"),
    ],
    ids=["no pool", "out of view", "another size", "a hidden side", "night", "two pools", "turned"],
)
def test_no_mount_is_better_than_a_wrong_one(
    view: View, sides: tuple[float, float], x_points: str, message: str
) -> None:
    with pytest.raises(CalibrationError, match=message) as refused:
        find_pool(picture(view), view.lens, sides, 0.0, x_points)
    assert "\n" not in str(refused.value)
