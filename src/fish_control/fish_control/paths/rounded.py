"""Polylines with circular fillets: the corners a fish can swim."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

ARC_STEP = 5e-4  # m between points on an arc; leaves a heading error of ARC_STEP / (8 radius) ~ 3e-4 rad
HAIRPIN = np.deg2rad(175.0)  # a corner sharper than this has no useful fillet


def round_corners(vertices: ArrayLike, radius: ArrayLike, closed: bool = False) -> NDArray[np.float64]:
    """Replace each corner by a circular arc tangent to both sides.

        tangent length = r tan(delta / 2), delta = deflection of the corner

    A radius that does not fit is reduced to what half of the shorter side allows.

    Args:
        vertices: (V, 2) corners [m]; the ends of an open polyline stay where they are.
        radius: wanted radius of the arcs [m], one for all or (V,); 0 leaves a corner sharp.
    Returns:
        (M, 2) dense points [m]; the first is not repeated when closed.
    """
    corners = np.asarray(vertices, dtype=float)
    count = len(corners)
    radii = np.broadcast_to(np.asarray(radius, dtype=float), count)
    rounded = []
    for i in range(count):
        if not closed and i in (0, count - 1):
            rounded.append(corners[i : i + 1])
            continue
        ends_before = not closed and i == 1
        ends_after = not closed and i == count - 2
        rounded.append(
            _fillet(corners[i - 1], corners[i], corners[(i + 1) % count], radii[i], ends_before, ends_after)
        )
    return np.vstack(rounded)


def _fillet(
    before: NDArray, corner: NDArray, after: NDArray, radius: float, ends_before: bool, ends_after: bool
) -> NDArray[np.float64]:
    """Arc at one corner; a side that ends the polyline may be used whole, others by half."""
    side_in, side_out = corner - before, after - corner
    length_in, length_out = np.hypot(*side_in), np.hypot(*side_out)
    t_in, t_out = side_in / length_in, side_out / length_out
    turn = np.arctan2(t_in[0] * t_out[1] - t_in[1] * t_out[0], t_in @ t_out)
    if radius <= 0.0 or abs(turn) < 1e-6 or abs(turn) > HAIRPIN:
        return corner[None]
    room = min(length_in * (1.0 if ends_before else 0.5), length_out * (1.0 if ends_after else 0.5))
    tangent_length = min(radius * np.tan(abs(turn) / 2.0), room)
    r = tangent_length / np.tan(abs(turn) / 2.0)
    centre = corner - tangent_length * t_in + np.sign(turn) * r * np.array([-t_in[1], t_in[0]])
    start = np.arctan2(t_in[1], t_in[0]) - np.sign(turn) * np.pi / 2.0
    angles = start + np.linspace(0.0, turn, max(int(np.ceil(r * abs(turn) / ARC_STEP)), 4) + 1)
    return centre + r * np.column_stack([np.cos(angles), np.sin(angles)])
