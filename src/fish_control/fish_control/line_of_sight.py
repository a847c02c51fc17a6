# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Line of sight: from pose and velocity to course, heading, speed and cross-track errors.

    chi_los = atan2(y_t - y, x_t - x)                 towards the lookahead point (the paper's law)
    chi_d   = chi_los - gamma                         wanted course; gamma: share of the path's own curvature

On a curved path chi_los alone points inside the curve by gamma = asin(L kappa / 2), which makes any
controller that tracks it cut corners (0.03 to 0.07 m on the letters); with gamma taken off, a robot on the
path aims along the path. From course to heading, in water that flows with c (learned on the way, see water):

    w       = U t(chi_d) - c                          velocity through the water; t: unit vector, U: wanted speed
    kappa_w = kappa U^2 (w . t) / |w|^3               curvature of the way through the water
    psi_d   = atan2(w_y, w_x) + a(|w|) kappa_w        wanted mean heading; a(u) = a_0 + a_1 u: slip in a turn
    e_psi   = wrap(psi_d - tau |w| kappa_w - psi_mean)   tau: by which psi_mean is late in a turn (stroke_mean)

Written on generic scalars: training runs the same lines in CasADi.

Source: line of sight: Fossen 2021, sect. 12.3; corner compensation, slip and current: this project.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Generic, NamedTuple, TypeVar

from fish_control.control_law import ControlLimits, Setpoint
from fish_control.current_observer import WaterState, bounded, see_across, see_ahead, swim
from fish_control.stroke_mean import TURN_LAG, StrokeState, stroke_step

# of the wanted speed, through the water: a stronger current ahead is not believed
LEAST_HEADWAY = 0.3
SLOW = 0.02  # m/s, a robot that is slower has no course of its own: its heading stands for it


@dataclass(frozen=True)
class GuidanceConfig:
    """Constants of the line of sight; part of a weights file's contract. Slip: steady turns of the nominal fish."""

    compensate_curvature: bool = True  # take gamma off; False is the paper's law
    slip_arm: float = 0.041  # m, a_0: in a curve the mean heading leads the course by a kappa
    slip_time: float = 0.196  # s, a_1
    learn_current: bool = True  # False: still water is assumed
    current_limit: float = 0.1  # m/s, of each component
    listen_time: float = 3.0  # s at rest before the first stroke; the water shows its current

    def __post_init__(self) -> None:
        for name in ("slip_arm", "slip_time", "current_limit", "listen_time"):
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
    """Memory: the stroke's swing and what the water does."""

    stroke: StrokeState = StrokeState()
    water: WaterState = WaterState()

    @classmethod
    def of(cls, values: Sequence[Any]) -> GuidanceState:
        """From the values in the order of `flat`."""
        count = len(StrokeState._fields)
        return cls(StrokeState(*values[:count]), WaterState(*values[count:]))

    @property
    def flat(self) -> list[Any]:
        """All values, in the order of GUIDANCE_NAMES."""
        return [*self.stroke, *self.water]


GUIDANCE_NAMES = (
    *(f"stroke.{n}" for n in StrokeState._fields),
    *(f"water.{n}" for n in WaterState._fields),
)


class TrackingErrors(NamedTuple):
    """Reference minus actual."""

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
    state: GuidanceState,
    motion: Motion,
    setpoint: Setpoint,
    dt: Any,
    limits: ControlLimits,
    config: GuidanceConfig,
    xp: Any,
) -> GuidanceState:
    """Update swing and water with a motion that lasted dt [s] under a set-point of rudder and throttle.

    Slip follows the rudder at once and the yaw rate late: on the letter R at 0.2 m/s what remains in still water is
    6 mm/s rms with the rudder's curvature, 25 mm/s with yaw rate over speed.
    """
    stroke = stroke_step(state.stroke, motion.yaw_rate, motion.sway, dt)
    if not config.learn_current:
        return state._replace(stroke=stroke)
    heading = mean_heading(stroke, motion)
    sin, cos = xp.sin(heading), xp.cos(heading)
    water = see_ahead(swim(state.water, setpoint, dt, limits), motion.surge, cos, sin, dt)
    slip = -slip_lever(water.speed, config) * water.speed * setpoint.alpha / limits.curvature_gain
    water = see_across(water, motion.sway - stroke.sway - slip, setpoint.alpha, cos, sin, dt)
    return GuidanceState(stroke, bounded(water, config.current_limit, xp))


def has_listened(listened: Any, motion: Motion, config: GuidanceConfig, xp: Any) -> Any:
    """Whether a robot that was seen at rest for `listened` [s] may swim: long enough, or it is under way already.

    While it does nothing, water that flows takes it along within seconds (drag over mass), ahead as well as aside; once it
    swims, a current ahead and a thrust that is not the nominal one look alike until the heading changes. Who is faster
    than any current that is believed is under way.
    """
    listens = config.learn_current * config.listen_time
    return (listened >= listens) | (xp.hypot(motion.surge, motion.sway) > config.current_limit)


def slip_lever(speed: Any, config: GuidanceConfig) -> Any:
    """a(u) [m] at a speed through the water [m/s]."""
    return config.slip_arm + config.slip_time * speed


def tracking_errors(
    stroke: StrokeState,
    motion: Motion,
    path: PathAhead,
    speed: Any,
    config: GuidanceConfig,
    xp: Any,
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


def through_water(
    state: GuidanceState, course: Any, curvature: Any, speed: Any, xp: Any
) -> WaterTrack:
    """What a wanted course [rad], curvature [1/m] and speed [m/s] over ground are in the water that flows."""
    cos, sin = xp.cos(course), xp.sin(course)
    ahead = xp.fmax(
        speed - cos * state.water.current_x - sin * state.water.current_y, LEAST_HEADWAY * speed
    )
    left = sin * state.water.current_x - cos * state.water.current_y
    through = xp.sqrt(ahead**2 + left**2)
    return WaterTrack(
        course + xp.arctan2(left, ahead), curvature * speed**2 * ahead / through**3, through
    )


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


# s, a longer gap between odometry messages, or a longer step back, restarts the filters
LONGEST_STEP = 0.1
State = TypeVar("State")


class MotionObserver(Generic[State]):
    """Feeds `advance(state, motion, dt)` with the time dt [s] that has passed between stamps."""

    def __init__(self, start: State, advance: Callable[[State, Motion, float], State]) -> None:
        self._start, self._advance = start, advance
        self._time: float | None = None
        self.state = start

    def add(self, time: float, motion: Motion) -> None:
        """Take in odometry stamped `time` [s]; what repeats a stamp or comes a little out of order is ignored."""
        dt = math.inf if self._time is None else time - self._time
        if abs(dt) > LONGEST_STEP:  # a gap, or a clock that was set back
            self.state = self._start
        elif dt > 0.0:
            self.state = self._advance(self.state, motion, dt)
        else:
            return
        self._time = time
