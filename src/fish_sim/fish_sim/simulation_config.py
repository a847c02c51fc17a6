# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Parameters of the simulated pool and of the simulator node."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

from fish_node import pool
from fish_node.arming import ArmingSettings
from fish_node.frames import BODY, IMU, POOL, require_frame, require_frame_prefix
from fish_sim.sensors import changes_camera_poses
from fish_sim.sensors.settings import SensorSettings


@dataclass(frozen=True)
class SimulationConfig(SensorSettings):
    """What is in the pool, where it starts, and how the robot treats stale commands."""

    robot_file: str = ""  # robot.yaml or a model.yaml of the diagnosis; empty: the nominal robot
    start_x: float = 0.0  # m, pool frame
    start_y: float = 0.0  # m
    start_heading: float = 0.0  # rad
    seed: int = 1  # of all noise
    walls: bool = True  # stop the head's centre at the pool's edge; false: the water has no end
    disturbance: float = 0.002  # N, std of the water's random push on the head; 0 = still water
    command_timeout: float = 0.25  # s, older commands are stale
    stop_time: float = (
        0.1  # s, in which the rotor of a stale command or of a disarmed robot runs down
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        for name, low, high in (
            ("start_x", -pool.LENGTH / 2, pool.LENGTH / 2),
            ("start_y", -pool.WIDTH / 2, pool.WIDTH / 2),
            ("start_heading", -2 * math.pi, 2 * math.pi),
            ("seed", 0, 2**31 - 1),
            ("disturbance", 0.0, 1.0),
            ("command_timeout", 0.02, 10.0),
            ("stop_time", 0.01, 10.0),
        ):
            value = getattr(self, name)
            if not low <= value <= high:
                raise ValueError(f"{name} = {value}: expected {low:g} to {high:g}")


@dataclass(frozen=True)
class SimulatorConfig(SimulationConfig, ArmingSettings):
    """ROS parameters of the simulator node.

    It owns the arming state as node rotor does on the robot. A busy computer delays pictures and estimates, and nothing
    real moves, so that an estimate is not needed and silence is borne for longer than on the robot.
    """

    estimate: str = "watched"  # required | watched | ignored: odometry/filtered and camera/pose
    pause_s: float = (
        1.0  # s that a pause of the controller, or a doubt of fusion, may last until then
    )
    odometry_timeout_s: float = 0.5  # s without new odometry/filtered until the robot is disarmed
    camera_timeout_s: float = 1.0  # s without a new camera/pose until the robot is disarmed
    real_time_factor: float = 1.0  # simulated per real second; 0 = as fast as possible
    camera: str = (
        "image"  # image: the camera node renders; pose: publish camera/pose from the sensor model
    )
    paused: bool = False  # start paused
    lockstep: float = (
        0.0  # s of real time to wait for estimates and commands that lag; 0 = do not wait
    )
    lockstep_slack: float = 0.0  # s of simulated time that they may lag without being waited for
    lockstep_camera: float = 0.0  # s of simulated time, likewise, of camera/pose after its stamp; 0 = it is not waited for
    pool_frame: str = POOL  # frame of the pool, which several fish share
    body_frame: str = BODY  # frame of the head's centre of mass
    imu_frame: str = IMU  # frame of imu/data
    frame_prefix: str = ""  # before every frame but the pool's, such as fish_2/ for a second fish

    def __post_init__(self) -> None:
        super().__post_init__()
        ArmingSettings.__post_init__(self)
        if not 0.0 <= self.real_time_factor <= 100.0:
            raise ValueError(f"real_time_factor = {self.real_time_factor}: expected 0 to 100")
        if not 0.0 <= self.lockstep <= 60.0:
            raise ValueError(f"lockstep = {self.lockstep}: expected 0 to 60 s")
        for name in ("lockstep_slack", "lockstep_camera"):
            if not 0.0 <= getattr(self, name) <= 1.0:
                raise ValueError(f"{name} = {getattr(self, name)}: expected 0 to 1 s")
        for name in ("pool_frame", "body_frame", "imu_frame"):
            require_frame(name, getattr(self, name))
        require_frame_prefix(self.frame_prefix)
        if self.camera not in ("image", "pose"):
            raise ValueError(f"camera = {self.camera!r}: expected 'image' or 'pose'")

    def idle_sensors(self, sensors: Iterable[str]) -> str:
        """What to say of a robot's sensor effects (names) that do nothing as the camera is set; empty if all act."""
        idle = [f"sensors.{name}" for name in sensors if changes_camera_poses(name)]
        if self.camera == "pose" or not idle:
            return ""
        return (
            f"{', '.join(idle)} of {self.robot_file}: without effect on the camera node's pictures"
            f" (camera:={self.camera}); with camera:=pose they act, on camera/pose"
        )
