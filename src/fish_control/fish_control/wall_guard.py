# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Whether a fish that does not look where it swims must be stopped before a wall. No ROS, no clock."""

from __future__ import annotations

import math

import numpy as np

from fish_control.line_of_sight import Motion
from fish_control.pool import stopping_side, wall_distance


def heads_for_a_wall(motion: Motion, horizon: float, margin: float) -> bool:
    """Whether `horizon` [s] on, at its present velocity, the fish is nearer to a wall than `margin` [m] and than it is now."""
    cos, sin = math.cos(motion.heading), math.sin(motion.heading)
    vx, vy = motion.surge * cos - motion.sway * sin, motion.surge * sin + motion.sway * cos
    ahead = wall_distance(np.array([[motion.x + horizon * vx, motion.y + horizon * vy]]))
    return ahead < margin and ahead < wall_distance(np.array([[motion.x, motion.y]]))


def stopping_rudder(motion: Motion, rudder_range: float) -> float:
    """Rudder [rad] hard over to the side on which the fish comes to rest farther from the walls."""
    return stopping_side(motion.x, motion.y, motion.heading) * rudder_range
