# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""An independent reading of simple SVG documents: de Casteljau, the arc's equations and products of matrices.

Nothing of fish_control or svgelements is used here.
"""

import itertools
import math

import numpy as np


def matrix(name, values):
    """(3, 3) of an SVG transform function, SVG 1.1, section 7.6."""
    if name == "matrix":
        a, b, c, d, e, f = values
    elif name == "translate":
        a, b, c, d, e, f = 1, 0, 0, 1, *values
    elif name == "scale":
        a, b, c, d, e, f = values[0], 0, 0, values[1], 0, 0
    elif name == "rotate":
        t = math.radians(values[0])
        cx, cy = values[1:] if len(values) > 1 else (0.0, 0.0)
        a, b, c, d = math.cos(t), math.sin(t), -math.sin(t), math.cos(t)
        e, f = cx - a * cx - c * cy, cy - b * cx - d * cy
    elif name == "skewX":
        a, b, c, d, e, f = 1, 0, math.tan(math.radians(values[0])), 1, 0, 0
    else:
        a, b, c, d, e, f = 1, math.tan(math.radians(values[0])), 0, 1, 0, 0
    return np.array([[a, c, e], [b, d, f], [0.0, 0.0, 1.0]])


def bezier(controls, t):
    """Points at parameters t by de Casteljau."""
    levels = [np.tile(np.asarray(c, float), (len(t), 1)) for c in controls]
    while len(levels) > 1:
        levels = [(1 - t)[:, None] * a + t[:, None] * b for a, b in itertools.pairwise(levels)]
    return levels[0]


def arc(start, radii, turned, large, sweep, end, t):
    """Points at parameters t of an elliptical arc, SVG 1.1, appendix F.6.5."""
    start, end = np.asarray(start, float), np.asarray(end, float)
    phi = math.radians(turned)
    axes = np.array([[math.cos(phi), math.sin(phi)], [-math.sin(phi), math.cos(phi)]])
    half = axes @ (start - end) / 2
    rx, ry = np.abs(radii)
    grow = math.sqrt(max(1.0, (half[0] / rx) ** 2 + (half[1] / ry) ** 2))
    rx, ry = rx * grow, ry * grow
    over = (rx * ry) ** 2 - (rx * half[1]) ** 2 - (ry * half[0]) ** 2
    below = (rx * half[1]) ** 2 + (ry * half[0]) ** 2
    c = math.sqrt(max(over, 0.0) / below) * (1 if large != sweep else -1)
    middle = np.array([c * rx * half[1] / ry, -c * ry * half[0] / rx])
    first = math.atan2((half[1] - middle[1]) / ry, (half[0] - middle[0]) / rx)
    last = math.atan2((-half[1] - middle[1]) / ry, (-half[0] - middle[0]) / rx)
    turn = (last - first) % (2 * math.pi) - (0 if sweep else 2 * math.pi)
    angle = first + turn * t
    local = middle + np.column_stack([rx * np.cos(angle), ry * np.sin(angle)])
    return local @ axes + (start + end) / 2


def placed(matrices, points):
    """Points after a product of matrices, the outermost first."""
    product = np.eye(3)
    for m in matrices:
        product = product @ m
    return points @ product[:2, :2].T + product[:2, 2]


def distance(points, line):
    """Largest distance of points from a polyline."""
    start, step = line[:-1], np.diff(line, axis=0)
    length = np.maximum((step**2).sum(axis=1), 1e-300)
    share = np.clip(((points[:, None] - start) * step).sum(axis=2) / length, 0.0, 1.0)
    near = start + share[..., None] * step
    return np.linalg.norm(points[:, None] - near, axis=2).min(axis=1).max()
