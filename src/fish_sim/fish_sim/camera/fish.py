# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The fish as coloured outlines in the pool's surface: what the camera has to draw."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from math import cos, pi, sin
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]  # float64
Colour = tuple[int, int, int]  # blue, green, red

BODY: Colour = (52, 50, 50)  # black plastic: no hue of its own under the markers
BACK: Colour = (78, 76, 76)  # where the head catches the light
TAIL: Colour = (62, 62, 62)
FIN: Colour = (44, 44, 44)
FRONT: Colour = (0, 215, 255)  # yellow
REAR: Colour = (210, 20, 235)  # magenta
TAIL_COLOURS: tuple[Colour, ...] = ((35, 55, 240), (40, 205, 45))  # red, green, red, ...


@dataclass(frozen=True)
class FishPose:
    """Pose of head and tail.

    x, y: head's centre of mass, pool frame, m. heading: rad, counter-clockwise from pool x.
    tail: relative angles of the tail links from the head backwards, rad, counter-clockwise positive.
    """

    x: float
    y: float
    heading: float
    tail: tuple[float, ...] = ()


@dataclass(frozen=True)
class Patch:
    """One filled outline: points (N, 2), m, in the pool frame or, of a plate, in base_link."""

    outline: Array
    colour: Colour


@dataclass(frozen=True)
class FishShape:
    """Lengths in metres. Source: MODEL.md of the project's specification; widths and markers: own choice."""

    head_length: float = 0.15
    head_width: float = 0.072
    hinge_offset: float = 0.075  # head's centre of mass to the tail's hinge
    link_length: float = 0.07 / 3
    fin_length: float = 0.03
    links: int = 3
    tail_width: float = 0.034  # at the hinge; tapers to half of it
    front_marker: float = 0.045  # ahead of the centre of mass
    rear_marker: float = -0.045
    marker_diameter: float = 0.030
    tail_marker_diameter: float = 0.016
    front_colour: Colour = FRONT
    rear_colour: Colour = REAR
    tail_colours: tuple[Colour, ...] = TAIL_COLOURS  # of links 1, 2, ...; repeated
    plates: tuple[
        Patch, ...
    ] = ()  # flat things on the head, outlines in base_link, such as a coded tag


def joints(pose: FishPose, shape: FishShape) -> tuple[Array, Array]:
    """Hinges (links + 1, 2) of the tail in the pool frame, m, and absolute link angles (links,), rad.

        h_0 = (x, y) - hinge_offset e(heading),  h_i = h_{i-1} - link_length e(theta_i)

    Missing tail angles count as zero (a straight tail); surplus ones are ignored.
    """
    relative = np.zeros(shape.links)
    count = min(shape.links, len(pose.tail))
    relative[:count] = pose.tail[:count]
    theta = pose.heading + np.cumsum(relative)
    steps = -np.column_stack([np.cos(theta), np.sin(theta)]) * shape.link_length
    h_0 = np.array([pose.x, pose.y]) - shape.hinge_offset * np.array(
        [cos(pose.heading), sin(pose.heading)]
    )
    return np.vstack([h_0, h_0 + np.cumsum(steps, axis=0)]), theta


def markers(pose: FishPose, shape: FishShape) -> list[tuple[Array, float, Colour]]:
    """Centre (2,) in the pool frame, m, diameter, m, colour: front, rear, then the far end of each link."""
    origin, ahead = np.array([pose.x, pose.y]), np.array([cos(pose.heading), sin(pose.heading)])
    head = [
        (origin + shape.front_marker * ahead, shape.marker_diameter, shape.front_colour),
        (origin + shape.rear_marker * ahead, shape.marker_diameter, shape.rear_colour),
    ]
    hinges, _ = joints(pose, shape)
    return head + [
        (h, shape.tail_marker_diameter, shape.tail_colours[i % len(shape.tail_colours)])
        for i, h in enumerate(hinges[1:])
    ]


def patches(pose: FishPose, shape: FishShape) -> list[Patch]:
    """Everything to fill, from the bottom up: fin, tail, head, markers, plates."""
    hinges, theta = joints(pose, shape)
    fin_end = hinges[-1] - shape.fin_length * np.array([cos(theta[-1]), sin(theta[-1])])
    widths = np.linspace(shape.tail_width, shape.tail_width / 2, shape.links + 1)
    result = [Patch(_taper(hinges[-1], fin_end, widths[-1] * 0.5, shape.tail_width * 0.9), FIN)]
    for near, far, wide, narrow in zip(
        hinges[:-1], hinges[1:], widths[:-1], widths[1:], strict=True
    ):
        result += [Patch(_disc(near, wide), TAIL), Patch(_taper(near, far, wide, narrow), TAIL)]
    result.append(Patch(_disc(hinges[-1], widths[-1]), TAIL))
    result += [
        Patch(_head(pose, shape, scale), colour) for scale, colour in ((1.0, BODY), (0.72, BACK))
    ]
    result += [
        Patch(_disc(centre, diameter), colour) for centre, diameter, colour in markers(pose, shape)
    ]
    return result + [Patch(_placed(pose, plate.outline), plate.colour) for plate in shape.plates]


def silhouette(pose: FishPose, shape: FishShape) -> Sequence[Array]:
    """Outlines of head and tail alone, for the shadow on the floor."""
    hinges, _ = joints(pose, shape)
    return [
        _head(pose, shape, 1.0),
        _taper(hinges[0], hinges[-1], shape.tail_width, shape.tail_width / 2),
    ]


@cache
def _circle(points: int) -> Array:
    """(points, 2) of the unit circle."""
    angles = np.arange(points) * (2 * pi / points)
    return np.column_stack([np.cos(angles), np.sin(angles)])


def _disc(centre: Array, diameter: float, points: int = 24) -> Array:
    return centre + 0.5 * diameter * _circle(points)


def _taper(near: Array, far: Array, near_width: float, far_width: float) -> Array:
    """Quadrilateral from near to far; empty length gives a degenerate, invisible one."""
    along = far - near
    across = np.array([-along[1], along[0]]) / max(float(np.hypot(*along)), 1e-9)
    return np.array(
        [
            near + across * near_width / 2,
            far + across * far_width / 2,
            far - across * far_width / 2,
            near - across * near_width / 2,
        ]
    )


def _head(pose: FishPose, shape: FishShape, scale: float, points: int = 40) -> Array:
    """Ellipse around the centre of mass, blunt ahead and pointed towards the tail."""
    along, across = _circle(points).T
    across = 0.5 * shape.head_width * across * (1.0 + 0.18 * along)
    along = 0.5 * shape.head_length * along
    return _placed(pose, scale * np.column_stack([along, across]))


def _placed(pose: FishPose, points: Array) -> Array:
    """Points (N, 2) of base_link in the pool frame, m."""
    c, s = cos(pose.heading), sin(pose.heading)
    turned: Array = points @ np.array([[c, s], [-s, c]])
    return np.array([pose.x, pose.y]) + turned
