"""Line of sight: from pose and velocity to course, heading, speed and cross-track errors.

    chi_los = atan2(y_t - y, x_t - x)                 towards the lookahead point (the paper's law)
    chi_d   = chi_los - gamma                         wanted course; gamma: share of the path's own curvature

On a curved path chi_los alone points inside the curve by gamma = asin(L kappa / 2), which makes any
controller that tracks it cut corners (0.03 to 0.07 m on the letters); with gamma taken off, a robot on the
path aims along the path. From course to heading, in water that flows with c:

    w       = U t(chi_d) - c                          velocity through the water; t: unit vector, U: wanted speed
    kappa_w = kappa U^2 (w . t) / |w|^3               curvature of the way through the water
    psi_d   = atan2(w_y, w_x) + a(|w|) kappa_w        wanted mean heading; a(u) = a_0 + a_1 u: slip in a turn
    e_psi   = wrap(psi_d - tau |w| kappa_w - psi_mean)   tau: by which psi_mean is late in a turn (stroke_mean)

Written on generic scalars: training runs the same lines in CasADi.

Source: line of sight: Fossen 2021, sect. 12.3; corner compensation, slip and current: this project.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

from fish_control.stroke_mean import TURN_LAG, StrokeState, stroke_step

LEAST_HEADWAY = 0.3  # of the wanted speed, through the water: a stronger current ahead is not believed
SLOW = 0.02  # m/s, a robot that is slower has no course of its own: its heading stands for it


@dataclass(frozen=True)
class GuidanceConfig:
    """Constants of the line of sight; part of a weights file's contract. Slip: steady turns of the nominal fish."""

    compensate_curvature: bool = True  # take gamma off; False is the paper's law
    slip_arm: float = 0.041  # m, a_0: in a curve the mean heading leads the course by a kappa
    slip_time: float = 0.196  # s, a_1
    current_time: float = 0.5  # s, how fast the current is learned; 0: still water is assumed
    current_limit: float = 0.1  # m/s, of each component

    def __post_init__(self) -> None:
        for name in ("slip_arm", "slip_time", "current_time", "current_limit"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value >= 0.0):
                raise ValueError(f"{name} is {value!r}, expected a finite number >= 0")


class Motion(NamedTuple):
    """Pose in the pool and velocity over ground in base_link."""

    x: Any  # m
    y: Any  # m
    heading: Any  # rad
    surge: Any  # m/s
    sway: Any  # m/s
    yaw_rate: Any  # rad/s


class PathAhead(NamedTuple):
    """What the path says at the robot's progress; see `PathState`."""

    x: Any  # m, point of the path at the progress
    y: Any  # m
    heading: Any  # rad
    curvature: Any  # 1/m
    target_x: Any  # m, lookahead point
    target_y: Any  # m
    chord: Any  # rad


class GuidanceState(NamedTuple):
    """Memory: the stroke's swing and the current in the pool frame."""

    stroke: StrokeState = StrokeState()
    current_x: Any = 0.0  # m/s
    current_y: Any = 0.0  # m/s


class TrackingErrors(NamedTuple):
    """Wanted minus actual."""

    cross_track: Any  # m, positive: robot left of the path
    heading: Any  # rad, of the way over ground (course), mean over a stroke, within +-pi
    speed: Any  # m/s
    course: Any  # rad, wanted course chi_d


class WaterTrack(NamedTuple):
    """The wanted motion as seen from the water."""

    heading: Any  # rad, of the velocity through the water
    curvature: Any  # 1/m
    speed: Any  # m/s


def observe(
    state: GuidanceState, motion: Motion, turn: Any, dt: Any, config: GuidanceConfig, xp: Any
) -> GuidanceState:
    """Update swing and current with a motion that lasted dt [s], its rudder set for a curvature `turn` [1/m].

        c' = n (v_mean + a(u) u turn - n . c) / T,   n = (-sin psi, cos psi)

    Only the current across the heading shows in the sway velocity; a robot that turns learns both components.
    Slip follows the rudder at once and the yaw rate late: on the letter R at 0.2 m/s what remains in still water is
    6 mm/s rms with the rudder's curvature, 25 mm/s with yaw rate over speed.
    """
    stroke = stroke_step(state.stroke, motion.yaw_rate, motion.sway, dt)
    if config.current_time == 0.0:
        return state._replace(stroke=stroke)
    heading = mean_heading(stroke, motion)
    sin, cos = xp.sin(heading), xp.cos(heading)
    slip = -slip_lever(motion.surge, config) * motion.surge * turn
    across = motion.sway - stroke.sway - slip
    missing = dt / (config.current_time + dt) * (across + sin * state.current_x - cos * state.current_y)
    limit = config.current_limit
    return GuidanceState(
        stroke,
        xp.fmin(xp.fmax(state.current_x - sin * missing, -limit), limit),
        xp.fmin(xp.fmax(state.current_y + cos * missing, -limit), limit),
    )


def slip_lever(speed: Any, config: GuidanceConfig) -> Any:
    """a(u) [m] at a speed through the water [m/s]."""
    return config.slip_arm + config.slip_time * speed


def tracking_errors(
    stroke: StrokeState, motion: Motion, path: PathAhead, speed: Any, config: GuidanceConfig, xp: Any
) -> TrackingErrors:
    """Errors of a robot against the path and the wanted surge speed [m/s]; what the water does is not asked."""
    wanted = xp.arctan2(path.target_y - motion.y, path.target_x - motion.x)
    if config.compensate_curvature:
        wanted = wanted - path.chord
    heading = mean_heading(stroke, motion)
    course = heading + xp.arctan2(motion.sway - stroke.sway, xp.fmax(motion.surge, SLOW))
    along_x, along_y = xp.cos(path.heading), xp.sin(path.heading)
    e_y = along_x * (motion.y - path.y) - along_y * (motion.x - path.x)
    return TrackingErrors(e_y, wrap(wanted - course, xp), speed - motion.surge, wrap(wanted, xp))


def through_water(state: GuidanceState, course: Any, curvature: Any, speed: Any, xp: Any) -> WaterTrack:
    """What a wanted course [rad], curvature [1/m] and speed [m/s] over ground are in the water that flows."""
    cos, sin = xp.cos(course), xp.sin(course)
    ahead = xp.fmax(speed - cos * state.current_x - sin * state.current_y, LEAST_HEADWAY * speed)
    left = sin * state.current_x - cos * state.current_y
    through = xp.sqrt(ahead**2 + left**2)
    return WaterTrack(course + xp.arctan2(left, ahead), curvature * speed**2 * ahead / through**3, through)


def heading_error(
    state: GuidanceState, motion: Motion, water: WaterTrack, config: GuidanceConfig, xp: Any
) -> Any:
    """e_psi = wrap(psi_d - tau |w| kappa_w - psi_mean) [rad]."""
    lever = slip_lever(water.speed, config) - TURN_LAG * water.speed
    return wrap(water.heading + lever * water.curvature - mean_heading(state.stroke, motion), xp)


def mean_heading(stroke: StrokeState, motion: Motion) -> Any:
    """psi_mean [rad], without the swing of the stroke."""
    return motion.heading - stroke.heading


def wrap(angle: Any, xp: Any) -> Any:
    """Angle within +-pi [rad], differentiable everywhere but at the seam."""
    return xp.arctan2(xp.sin(angle), xp.cos(angle))
