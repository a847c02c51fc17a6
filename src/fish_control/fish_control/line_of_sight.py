"""Line of sight: from pose and velocity to course, heading, speed and cross-track errors.

    chi_los = atan2(y_t - y, x_t - x)                 towards the lookahead point (the paper's law)
    chi_d   = chi_los - gamma                         wanted course; gamma: share of the path's own curvature
    psi_d   = chi_d + a kappa - beta                  wanted mean heading: slip in a turn, drift in a current
    e_psi   = wrap(psi_d - psi_mean)

On a curved path chi_los alone points inside the curve by gamma = asin(L kappa / 2), which makes any
controller that tracks it cut corners (0.03 to 0.07 m on the letters); with gamma taken off, a robot on the
path aims along the path. Written on generic scalars: training runs the same lines in CasADi.

Source: line of sight: Fossen 2021, sect. 12.3; corner compensation, slip and drift terms: this project.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

from fish_control.stroke_mean import StrokeState, stroke_step


@dataclass(frozen=True)
class GuidanceConfig:
    """Constants of the line of sight; part of a weights file's contract."""

    compensate_curvature: bool = True  # take gamma off; False is the paper's law
    slip_arm: float = 0.073  # m, a: in a curve the mean heading leads the course by a kappa; nominal fish
    drift_time: float = 1.0  # s, low-pass of the drift angle; 0 switches it off
    drift_speed: float = 0.05  # m/s, below this speed the drift angle fades out
    drift_limit: float = 0.5  # rad

    def __post_init__(self) -> None:
        for name in ("slip_arm", "drift_time", "drift_speed", "drift_limit"):
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
    """Memory: the stroke's swing and the drift angle."""

    stroke: StrokeState = StrokeState()
    drift: Any = 0.0  # rad


class TrackingErrors(NamedTuple):
    """Wanted minus actual."""

    cross_track: Any  # m, positive: robot left of the path
    heading: Any  # rad, of the mean heading, within +-pi
    speed: Any  # m/s
    course: Any  # rad, wanted course chi_d


def observe(state: GuidanceState, motion: Motion, dt: Any, config: GuidanceConfig, xp: Any) -> GuidanceState:
    """Update swing and drift with a motion that lasted dt [s].

        beta' = (fade (atan2(v_mean, u) + a r_mean / u) - beta) / T,   fade = u^2 / (u^2 + u_0^2)

    In still water a steady turn slips by v / u = -a kappa, so beta stays near zero; a current across makes it
    the crab angle.
    """
    stroke = stroke_step(state.stroke, motion.yaw_rate, motion.sway, dt)
    if config.drift_time == 0.0:
        return GuidanceState(stroke, state.drift)
    u2 = motion.surge * motion.surge
    v_mean, r_mean = motion.sway - stroke.sway, motion.yaw_rate - stroke.heading_rate
    slip = motion.surge * (v_mean + config.slip_arm * r_mean) / (u2 + config.drift_speed**2)
    drift = state.drift + dt / (config.drift_time + dt) * (slip - state.drift)
    return GuidanceState(stroke, xp.fmin(xp.fmax(drift, -config.drift_limit), config.drift_limit))


def tracking_errors(
    state: GuidanceState, motion: Motion, path: PathAhead, speed: Any, config: GuidanceConfig, xp: Any
) -> TrackingErrors:
    """Errors of a robot against the path and the wanted surge speed [m/s]."""
    course = xp.arctan2(path.target_y - motion.y, path.target_x - motion.x)
    if config.compensate_curvature:
        course = course - path.chord
    e_psi = heading_error(state, motion, course, path.curvature, config, xp)
    along_x, along_y = xp.cos(path.heading), xp.sin(path.heading)
    e_y = along_x * (motion.y - path.y) - along_y * (motion.x - path.x)
    return TrackingErrors(e_y, e_psi, speed - motion.surge, wrap(course, xp))


def heading_error(
    state: GuidanceState, motion: Motion, course: Any, curvature: Any, config: GuidanceConfig, xp: Any
) -> Any:
    """e_psi = wrap(chi_d + a kappa - beta - psi_mean) [rad] for a course [rad] and curvature [1/m]."""
    heading = course + config.slip_arm * curvature - state.drift
    return wrap(heading - (motion.heading - state.stroke.heading), xp)


def wrap(angle: Any, xp: Any) -> Any:
    """Angle within +-pi [rad], differentiable everywhere but at the seam."""
    return xp.arctan2(xp.sin(angle), xp.cos(angle))
