# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Parameters of the nodes fusion, planner, controller and exciter."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import get_args

from fish_control.fusion_config import FusionConfig
from fish_control.line_of_sight import GuidanceConfig
from fish_control.path_batch import TrackerConfig
from fish_control.planner import FASTEST, SLOWEST
from fish_control.reference_path import End
from fish_node.frames import BODY, IMU, POOL, require_frame, require_frame_prefix

LARGEST_GAIN = 10.0
LARGEST_VARIANCE = 0.01  # m^2, rad^2, of a pose; it grows while the camera is lost


def require_range(name: str, value: float, lowest: float, highest: float, unit: str) -> None:
    """Raise ValueError naming field, value and range."""
    if not (math.isfinite(value) and lowest <= value <= highest):
        raise ValueError(f"{name} is {value!r} {unit}, expected {lowest:g} to {highest:g} {unit}")


def require_one_of(name: str, value: str, known: tuple[str, ...]) -> None:
    """Raise ValueError naming field, value and choices."""
    if value not in known:
        raise ValueError(f"{name} is {value!r}; known: {', '.join(known)}")


@dataclass(frozen=True)
class FusionNodeConfig(FusionConfig):
    """Constants of the fusion, and its frames."""

    pool_frame: str = POOL  # frame of the pose, which several fish share
    body_frame: str = BODY  # frame of the head's centre of mass
    imu_frame: str = IMU  # frame of the IMU, whose axes are those of body_frame
    frame_prefix: str = ""  # before every frame but the pool's, such as fish_2/ for a second fish

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("pool_frame", "body_frame", "imu_frame"):
            require_frame(name, getattr(self, name))
        require_frame_prefix(self.frame_prefix)


@dataclass(frozen=True)
class PlannerConfig:
    """What to swim and how the path is followed."""

    path: str = (
        "R"  # a letter, a family (circle, ...), a .csv or .svg file, or topic: reference/path
    )
    path_args: str = ""  # YAML, arguments of the family: "{radius: 0.6, x: 0.2}"
    speed: float = 0.2  # m/s, surge
    end: str = ""  # stop or loop; empty: a closed path loops, an open one stops
    start: str = "beginning"  # beginning, or nearest: the nearest point of the path
    margin: float = 0.1  # m, smallest distance of path and walls
    rate_hz: float = 50.0  # Hz, of target and errors, in steps of the odometry's rate
    lookahead: float = TrackerConfig.lookahead  # m
    lookahead_mode: str = TrackerConfig.lookahead_mode  # distance from the robot, or along the path
    search_window: float = TrackerConfig.search_window  # m
    capture_distance: float = TrackerConfig.capture_distance  # m
    compensate_curvature: bool = GuidanceConfig.compensate_curvature  # False: the paper's law
    state_file: str = ""  # progress for a restart after a crash; empty: in the system's folder for temporary files
    resume_timeout: float = 10.0  # s, older progress is not resumed; 0 never resumes
    largest_variance: float = (
        LARGEST_VARIANCE  # of a pose; nothing is planned from one that is lost
    )
    pool_frame: str = POOL  # frame of path and target
    body_frame: str = BODY  # frame of control/twist
    frame_prefix: str = ""  # before every frame but the pool's, such as fish_2/ for a second fish

    def __post_init__(self) -> None:
        require_range("speed", self.speed, SLOWEST, FASTEST, "m/s")
        require_one_of("end", self.end, ("", *get_args(End)))
        require_one_of("start", self.start, ("beginning", "nearest"))
        require_range("margin", self.margin, 0.0, 1.0, "m")
        require_range("rate_hz", self.rate_hz, 1.0, 100.0, "Hz")
        require_range("resume_timeout", self.resume_timeout, 0.0, 3600.0, "s")
        require_range("largest_variance", self.largest_variance, 1e-6, 1e3, "")
        require_frame("pool_frame", self.pool_frame)
        require_frame("body_frame", self.body_frame)
        require_frame_prefix(self.frame_prefix)
        self.tracker()

    def ending(self) -> End | None:
        """What `end` says; None where the path decides."""
        return {"stop": "stop", "loop": "loop"}.get(self.end)  # type: ignore[return-value]

    def tracker(self) -> TrackerConfig:
        """The part for the path tracker."""
        return TrackerConfig(
            self.lookahead,
            self.lookahead_mode,  # type: ignore[arg-type]
            self.search_window,
            self.capture_distance,
        )

    def guidance(self) -> GuidanceConfig:
        """The part for the line of sight."""
        return GuidanceConfig(compensate_curvature=self.compensate_curvature)


@dataclass(frozen=True)
class ControllerConfig:
    """Which gains, how fast, and when to stop."""

    weights_file: str = ""  # safetensors with contract; empty: the one installed with the package
    rate_hz: float = 50.0  # Hz, control period; must be the weights file's
    command_rate_hz: float = 100.0  # Hz, joint commands; a multiple of rate_hz
    lookahead: float = TrackerConfig.lookahead  # m, must be the weights file's and the planner's
    robot_hash: str = ""  # refuse weights trained for another robot; empty: accept any
    odometry_timeout: float = 0.15  # s
    target_timeout: float = 0.15  # s
    largest_variance: float = LARGEST_VARIANCE  # of an estimate that is not lost
    resume_delay: float = 0.2  # s, how long all must be well until the fish swims on after a pause
    arming_required: bool = True  # false: swim also while nobody publishes arming/state
    gains_lowest: tuple[float, ...] = (
        *(0.0,) * 6,  # least gains: steering Kp, Ki, Kd, then speed Kp, Ki, Kd
    )
    gains_highest: tuple[float, ...] = (
        *(LARGEST_GAIN,)
        * 6,  # greatest gains, likewise; the weights file's own range holds as well
    )

    def __post_init__(self) -> None:
        require_range("rate_hz", self.rate_hz, 10.0, 200.0, "Hz")
        require_range("command_rate_hz", self.command_rate_hz, self.rate_hz, 400.0, "Hz")
        if (
            abs(self.command_rate_hz / self.rate_hz - round(self.command_rate_hz / self.rate_hz))
            > 1e-9
        ):
            rates = (
                f"{self.command_rate_hz!r} Hz, expected a multiple of rate_hz {self.rate_hz!r} Hz"
            )
            raise ValueError(f"command_rate_hz is {rates}")
        require_range("lookahead", self.lookahead, 0.05, 2.0, "m")
        require_range("odometry_timeout", self.odometry_timeout, 0.02, 5.0, "s")
        require_range("target_timeout", self.target_timeout, 0.02, 5.0, "s")
        require_range("largest_variance", self.largest_variance, 1e-6, 1e3, "")
        require_range("resume_delay", self.resume_delay, 0.0, 60.0, "s")
        self._check_gains()

    def _check_gains(self) -> None:
        for name in ("gains_lowest", "gains_highest"):
            gains = getattr(self, name)
            if len(gains) != 6 or not all(0.0 <= gain <= LARGEST_GAIN for gain in gains):
                raise ValueError(
                    f"{name} is {list(gains)}, expected six numbers, 0 to {LARGEST_GAIN:g}"
                )
        if any(low > high for low, high in zip(self.gains_lowest, self.gains_highest, strict=True)):
            raise ValueError(
                f"gains_lowest is {list(self.gains_lowest)}, expected none above gains_highest {list(self.gains_highest)}"
            )


@dataclass(frozen=True)
class ExciterConfig:
    """Which part of which program, and when to stop."""

    program_file: str = (
        ""  # JSON or YAML rows of t, amplitude, frequency, rudder; a diagnosis.json holds them too
    )
    begin: float = 0.0  # s of the program's time
    end: float = 0.0  # s of the program's time; 0: its end, 8 s after its last row begins
    rest: float = 1.0  # s at rest before the first stroke
    command_rate_hz: float = 100.0  # Hz, joint commands
    guard: bool = (
        True  # stop before walls and when the estimate is lost; false: swim without looking
    )
    horizon: float = 1.0  # s, how far ahead the guard looks
    margin: float = 0.15  # m, nearer to a wall the fish must not be then
    odometry_timeout: float = 0.5  # s
    largest_variance: float = LARGEST_VARIANCE  # of an estimate that is not lost
    arming_required: bool = True  # false: swim also while nobody publishes arming/state

    def __post_init__(self) -> None:
        require_range("begin", self.begin, 0.0, 3600.0, "s")
        require_range("end", self.end, 0.0, 3600.0, "s")
        require_range("rest", self.rest, 0.0, 60.0, "s")
        require_range("command_rate_hz", self.command_rate_hz, 50.0, 400.0, "Hz")
        require_range("horizon", self.horizon, 0.0, 10.0, "s")
        require_range("margin", self.margin, 0.0, 1.0, "m")
        require_range("odometry_timeout", self.odometry_timeout, 0.02, 5.0, "s")
        require_range("largest_variance", self.largest_variance, 1e-6, 1e3, "")
