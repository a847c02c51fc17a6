# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""calibrate mount: position and tilt of the camera from known points of the pool, listed, clicked or found."""

import argparse
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import yaml

from fish_node.pool import pool_sides
from fish_vision.annotate import drawn_pool
from fish_vision.calibrate import (
    POINTS_MIN,
    KnownPoints,
    mount_from_points,
    pool_corners,
    read_points,
)
from fish_vision.calibration import (
    POOL,
    Array,
    Calibration,
    CalibrationError,
    Lens,
    Mount,
    read_lens,
)
from fish_vision.pool_outline import X_POINTS, find_pool
from fish_vision.segmentation import Image
from fish_vision.tags import TagDetector
from fish_vision.verbs.pictures import (
    PickingPage,
    Points,
    add_picture_arguments,
    new_file,
    one_picture,
    write_picture,
)

RMS_LIMIT = 5.0  # pixels; worse points are swapped or mistyped
TAG_LEAST = 12.0  # pixels, shortest side of a tag that is looked for
MARK, EDGE = (60, 60, 255), (60, 230, 60)  # blue, green, red


def add_parser(verbs: Any) -> None:
    """The sub-command."""
    mount = verbs.add_parser(
        "mount", help="position and tilt of the camera from known points of the pool"
    )
    mount.add_argument(
        "points",
        nargs="?",
        type=Path,
        help="CSV in the pool frame, m, with header x,y,u,v (pixels are known), x,y (to click on a page) or id,x,y "
        "(middles of coded tags); without it the pool's corners are clicked, or found with --find",
    )
    mount.add_argument("--lens", required=True, type=Path, help="file written by `calibrate lens`")
    add_picture_arguments(mount)
    mount.add_argument(
        "--find",
        action="store_true",
        help="find the pool's outline in the picture instead of having its corners clicked",
    )
    mount.add_argument(
        "--pool",
        default=f"{POOL[0]:g}x{POOL[1]:g}",
        help=f"the pool's sides along x and y at the water, m ({POOL[0]:g}x{POOL[1]:g})",
    )
    mount.add_argument(
        "--x-points",
        choices=X_POINTS,
        default="right",
        help="with --find: where the pool's x axis points in the picture (right)",
    )
    mount.add_argument("--dictionary", default="4X4_50", help="of the tags")
    mount.add_argument("--port", type=int, default=0, help="of the page; 0 takes a free one")
    mount.add_argument("--height", type=float, default=0.0, help="of the points above the water, m")
    mount.add_argument(
        "--out", type=Path, default=Path("mount.yaml"), help="params file for the tracker"
    )
    mount.add_argument(
        "--picture", type=Path, default=Path("mount.png"), help="points and pool, drawn"
    )
    mount.set_defaults(calibrate=calibrate_mount)


def calibrate_mount(args: argparse.Namespace) -> None:
    """Write a params file with camera_position and camera_tilt, and a picture of the points."""
    out, marked = new_file(args.out), new_file(args.picture)
    lens = read_lens(args.lens)
    sides = _sides(args.pool)
    if args.find:
        _find(args, lens, sides, out, marked)
        return
    known = read_points(args.points) if args.points else pool_corners(sides)
    picture = one_picture(args, lens)
    if known.pixels is None and picture is None:
        raise CalibrationError("these points have no pixels: expected --image or --topic")
    if picture is None:
        picture = np.zeros((lens.size[1], lens.size[0], 3), np.uint8)
    known = _located(known, picture, lens, args)
    mount, rms, millimetres = _fit(lens, known, args.height)
    if rms > RMS_LIMIT:
        raise CalibrationError(
            f"{args.points or 'clicked points'}: the points fit to {rms:.1f} pixels rms only: expected below {RMS_LIMIT}; "
            "a point is mistaken or the lens file is of another camera"
        )
    write_picture(marked, _drawn(picture, lens, mount, known, args.height, sides))
    _write(out, mount)
    print(
        f"{out}: {len(known.places)} points, error {rms:.2f} pixels rms, {millimetres:.1f} mm on the water plane, camera "
        f"{mount.position[2]:.3f} m high; {marked} shows it"
    )


def _sides(text: str) -> tuple[float, float]:
    """Sides of the pool as LENGTHxWIDTH, m."""
    try:
        return pool_sides(text)
    except ValueError as error:
        raise CalibrationError(f"--pool {error}") from error


def _find(
    args: argparse.Namespace, lens: Lens, sides: tuple[float, float], out: Path, marked: Path
) -> None:
    """Mount from the pool's outline in the picture."""
    picture = one_picture(args, lens)
    if args.points or picture is None:
        raise CalibrationError(
            "--find needs a picture and no list of points: expected --image or --topic"
        )
    found = find_pool(picture, lens, sides, args.height, args.x_points)
    known = pool_corners(sides)
    corners = KnownPoints(known.names, known.places, found.corners)
    shown = _drawn(picture, lens, found.mount, corners, args.height, sides)
    for u, v in np.round(found.points).astype(int).tolist():
        cv2.circle(shown, (u, v), 2, EDGE, 1, cv2.LINE_AA)
    write_picture(marked, shown)
    _write(out, found.mount)
    print(
        f"{out}: outline of {args.pool} m found, {len(found.points)} edge points, error {found.rms:.2f} pixels rms, "
        f"{found.millimetres:.1f} mm on the water plane, at least {100 * min(found.seen):.0f} % of each side seen, camera "
        f"{found.mount.position[2]:.3f} m high; {marked} shows it: the outline must lie on the walls at the water"
    )


def _write(out: Path, mount: Mount) -> None:
    """The params file."""
    values = {"camera_position": list(mount.position), "camera_tilt": list(mount.tilt)}
    out.write_text(yaml.safe_dump({"/**": {"ros__parameters": values}}))


def _located(
    known: KnownPoints, picture: Image, lens: Lens, args: argparse.Namespace
) -> KnownPoints:
    """The points with their pixels: as listed, found as tags, or clicked."""
    if known.pixels is not None:
        return known
    if known.tags:
        return _tags_found(known, picture, args.dictionary)

    def preview(points: Points) -> tuple[str, Image | None]:
        if len(points) < POINTS_MIN:
            return f"{len(points)} of {POINTS_MIN} points or more", None
        chosen = known.at(points)
        try:
            mount, rms, millimetres = _fit(lens, chosen, args.height)
            shown = _drawn(picture, lens, mount, chosen, args.height, _sides(args.pool))
        except CalibrationError as error:
            return str(error), None
        return f"error {rms:.2f} pixels rms, {millimetres:.1f} mm on the water plane", shown

    page = PickingPage(picture, known.names, preview, args.port)
    print(f"open {page.address} and click {len(known.names)} points", flush=True)
    return known.at(page.wait())


def _tags_found(known: KnownPoints, picture: Image, dictionary: str) -> KnownPoints:
    try:
        tags = TagDetector(dictionary).find(picture, TAG_LEAST)
    except ValueError as error:
        raise CalibrationError(f"--dictionary: {error}") from error
    middles = {str(tag.number): _middle(tag.corners) for tag in tags}
    found = {name: middles[name] for name in known.names if name in middles}
    if len(found) < POINTS_MIN:
        raise CalibrationError(
            f"tags {', '.join(found) or 'none'} of {', '.join(known.names)} were found: expected {POINTS_MIN} or more; check "
            f"--dictionary {dictionary}, light, and that each side has {TAG_LEAST:.0f} pixels"
        )
    return known.at(found)


def _middle(corners: Array) -> tuple[float, float]:
    """Where the diagonals of a tag cross, pixels: its middle also in perspective."""
    a, b, c, d = corners
    share = np.linalg.solve(np.column_stack([c - a, b - d]), b - a)[0]
    u, v = a + share * (c - a)
    return float(u), float(v)


def _fit(lens: Lens, known: KnownPoints, height: float) -> tuple[Mount, float, float]:
    """Mount, error in pixels and error on the plane of the points in mm, both root mean square."""
    assert known.pixels is not None
    points = np.column_stack([known.places, np.full(len(known.places), height)])
    mount, rms = mount_from_points(lens, points, known.pixels)
    off = Calibration(lens, mount, height).pixel_to_pool(known.pixels) - known.places
    return mount, rms, 1e3 * float(np.sqrt(np.mean(np.sum(off**2, axis=1))))


def _drawn(
    picture: Image,
    lens: Lens,
    mount: Mount,
    known: KnownPoints,
    height: float,
    sides: tuple[float, float],
) -> Image:
    """Copy of a picture with the pool's outline, the points where they were seen and where the mount shows them."""
    assert known.pixels is not None
    calibration = Calibration(lens, mount, height)
    result = drawn_pool(picture, calibration, sides)
    for name, seen, shown in zip(
        known.names, known.pixels, calibration.pool_to_pixel(known.places), strict=True
    ):
        u, v = np.round(seen).astype(int).tolist()
        cv2.drawMarker(result, (u, v), MARK, cv2.MARKER_CROSS, 14)
        cv2.circle(result, np.round(shown).astype(int).tolist(), 7, MARK, 1, cv2.LINE_AA)
        cv2.putText(result, name, (u + 9, v - 6), cv2.FONT_HERSHEY_SIMPLEX, 0.5, MARK, 1)
    return result
