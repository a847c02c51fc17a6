# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The pool with the fish in it, one command period at a time: physics, walls, water disturbance, sensors. No ROS.

The walls stop the centre of the fish's head, and count how often it came to them:

|x| <= LENGTH / 2,   |y| <= WIDTH / 2          pool frame
beyond a wall: the coordinate is the wall's, the velocity along its normal is 0   (plain inelastic contact)
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fish_node.pool import LENGTH, WIDTH
from fish_sim.model import DT
from fish_sim.robot import Robot
from fish_sim.sensors.distortion import SensorDistortion
from fish_sim.sensors.onboard import Battery, Encoder, Imu, ImuSample
from fish_sim.sensors.overhead_camera import CameraPose, OverheadCamera
from fish_sim.simulation_config import SimulationConfig
from fish_sim.step import Stepper
from fish_sim.water_push import WaterPush

Array = NDArray[np.float64]

EDGE = np.array([LENGTH / 2, WIDTH / 2])  # m
APART = 1.0  # s that the fish is off all walls before its next touch is a new contact; it swings twice a second


class Walls:
    """Holds one fish inside the pool; `contacts` counts, `place` is where the newest contact began [m]."""

    def __init__(self) -> None:
        self.contacts = 0
        self.place = (math.nan, math.nan)
        self._touched = -math.inf

    def touches(self, time: float) -> bool:
        """Whether the contact goes on at `time` [s]."""
        return time - self._touched < APART

    def leave(self) -> None:
        """The fish was taken away: its next touch is a new contact."""
        self._touched = -math.inf

    def hold(self, time: float, position: Array, velocity: Array) -> NDArray[np.bool_]:
        """Stop position (2,) [m] and velocity (2,) [m/s] in place at `time` [s]; which of x and y a wall stopped."""
        stopped: NDArray[np.bool_] = np.abs(position) > EDGE
        if not stopped.any():
            return stopped
        if not self.touches(time):
            self.contacts += 1
            self.place = (
                float(np.clip(position[0], -EDGE[0], EDGE[0])),
                float(np.clip(position[1], -EDGE[1], EDGE[1])),
            )
        self._touched = time
        outward = stopped & (velocity * position > 0.0)
        position[stopped] = np.copysign(EDGE, position)[stopped]
        velocity[outward] = 0.0
        return stopped


BATTERY_PERIOD = 1.0  # s
MAX_ROTOR_SPEED = 1000.0  # rad/s; a faster command is a mistake


@dataclass(frozen=True)
class Truth:
    """Where the fish is."""

    pose: tuple[float, float, float]  # m, m, rad; pool frame, heading not wrapped
    velocity: tuple[float, float, float]  # m/s, m/s, rad/s; surge, sway, yaw rate in base_link
    tail: tuple[float, ...]  # rad, relative angles of the links, counter-clockwise positive


@dataclass(frozen=True)
class Readings:
    """Everything that is measured at the end of a period."""

    time: float  # s since the start
    truth: Truth
    rotor: tuple[float, float]  # rad, rad/s; encoder
    imu: ImuSample
    camera: list[CameraPose]  # samples that arrived in this period
    battery: float | None  # V, once a second


class Simulation:
    """Follows the newest command; without a fresh one, or disarmed, the rotor runs down and the rudder centres.

    Attributes:
        walls: the pool's walls and the contacts with them; without `config.walls` nothing asks them.
    """

    def __init__(self, robot: Robot, config: SimulationConfig) -> None:
        self._config = config
        self._water = WaterPush.of_force(config.disturbance)
        self._robot = robot.with_effect("disturbance", **robot.effects.get("disturbance", {}))
        self._stepper = Stepper.of(self._robot)
        self._parameters = self._stepper.parameters(self._robot)
        names = self._stepper.layout.parameters
        self._pushed = [names.index(f"disturbance.{key}") for key in ("surge", "sway", "yaw")]
        self._constant_push = self._parameters[self._pushed].copy()
        self._periods = 0  # since the start; a reset does not turn time back
        self._armed, self._disarmed_time = True, math.inf
        self._last_command = (0.0, 0.0)
        self.resets = -1
        self.walls = Walls()
        self.reset()
        after = self._stepper.step(self._state, np.zeros(2), self._parameters)
        self._acceleration(self._state, after)  # compiles the kernels now, not later

    def reset(self) -> None:
        """Fish at rest at the start pose, no command, sensors and water as at the first start."""
        config = self._config
        random = np.random.default_rng(config.seed)
        self._random = random
        self._state = self._stepper.rest(
            (config.start_x, config.start_y, config.start_heading), parameters=self._parameters
        )
        self.walls.leave()
        self._push = np.zeros(3)
        self._rotor_angle = 0.0
        self._command, self._command_time = (0.0, 0.0), -math.inf
        distortion = SensorDistortion(self._robot.sensors)
        self._distortion = distortion
        self._imu = Imu(config, random, distortion.imu_delay())
        self._encoder = Encoder(config, random)
        self._camera = OverheadCamera(config, distortion, random)
        self._battery = Battery(config, random)
        self._battery_due = self.time + DT
        self.resets += 1

    @property
    def time(self) -> float:
        """Since the start [s]."""
        return self._periods * DT

    @property
    def command_age(self) -> float:
        """Time since the last command [s]; infinite before the first."""
        return self.time - self._command_time

    def follow(self, armed: bool) -> None:
        """Whether rotor and rudder follow commands from the next period on; a new simulation does."""
        if self._armed and not armed:
            self._disarmed_time, self._last_command = self.time, self.effective_command()
        self._armed = armed

    def command(self, rotor_speed: float, rudder: float) -> None:
        """Follow this from the next period on [rad/s, rad]. Raises ValueError for what no motor can do."""
        if not (math.isfinite(rotor_speed) and abs(rotor_speed) <= MAX_ROTOR_SPEED):
            raise ValueError(
                f"rotor velocity = {rotor_speed}: expected at most {MAX_ROTOR_SPEED} rad/s"
            )
        if not (math.isfinite(rudder) and abs(rudder) <= math.pi):
            raise ValueError(f"rudder position = {rudder}: expected at most pi rad")
        self._command, self._command_time = (rotor_speed, rudder), self.time

    def effective_command(self) -> tuple[float, float]:
        """The command; a stale one or a disarmed robot lets the rotor run down in stop_time and the rudder centre."""
        late, speed = self.command_age - self._config.command_timeout, self._command[0]
        if not self._armed:
            late, speed = self.time - self._disarmed_time, self._last_command[0]
        elif late <= 0.0:
            return self._command
        if late >= self._config.stop_time:
            return 0.0, 0.0
        return speed * (1.0 - late / self._config.stop_time), 0.0

    def advance(self) -> Readings:
        """One period of DT; raises FloatingPointError (after a reset) if the motion diverges."""
        before = self._state
        self._stir_water()
        after = self._stepper.step(before, np.array(self.effective_command()), self._parameters)
        self._periods += 1
        if not np.all(np.isfinite(after)):
            self.reset()
            raise FloatingPointError("the motion diverged; the simulation starts again")
        stopped = self._hold(after)
        self._state = after
        return self._measure(before, after, stopped)

    def _hold(self, after: np.ndarray) -> np.ndarray:
        """Stop the head at the walls, in place; which of x and y they stopped (2,)."""
        if not self._config.walls:
            return np.zeros(2, dtype=bool)
        size = 3 + self._stepper.layout.links
        return self.walls.hold(self.time, after[:2], after[size : size + 2])

    def _stir_water(self) -> None:
        """The water's next random push, with the standard deviation `disturbance`."""
        self._push = self._water.after(self._push, self._random.standard_normal(3))
        self._parameters[self._pushed] = self._constant_push + self._push

    def _acceleration(self, before: np.ndarray, after: np.ndarray) -> tuple[float, float]:
        """Of the head's centre of mass at the end of a period [m/s^2], pool frame: stamps are the moment of measurement.

        The mean over the period would be that of 5 ms earlier, by which a model fitted to such samples is wrong. Rotor and
        rudder move as in the period that ends; what they do next nobody knows yet.
        """
        size, motion = 3 + self._stepper.layout.links, len(self._stepper.layout.motion)
        (alpha, speed), (alpha_before, speed_before) = (
            after[motion : motion + 2],
            before[motion : motion + 2],
        )
        drive = np.array([[alpha, (alpha - alpha_before) / DT, speed, (speed - speed_before) / DT]])
        now = after[None, :motion]
        still = (np.zeros_like(now), np.zeros_like(drive), np.zeros_like(self._parameters))
        rates, _ = self._stepper.rates_jvp(now, drive, self._parameters, *still)
        return float(rates[0, size]), float(rates[0, size + 1])

    def _measure(self, before: np.ndarray, after: np.ndarray, stopped: np.ndarray) -> Readings:
        """What is true and what the sensors say; stopped: which of x and y a wall stopped in this period (2,).

        Along a wall's normal the accelerometer feels how the velocity changed in the period: the wall takes up the push.
        """
        links = self._stepper.layout.links
        size, motion = 3 + links, len(self._stepper.layout.motion)
        x, y, heading = after[:3]
        cos, sin = math.cos(heading), math.sin(heading)
        vx, vy, rate = after[size : size + 3]
        acceleration = np.array(self._acceleration(before, after))
        acceleration[stopped] = (after - before)[size : size + 2][stopped] / DT
        ax, ay = map(float, acceleration)
        speed_before, speed = before[motion + 1], after[motion + 1]
        self._rotor_angle += 0.5 * DT * (speed_before + speed)  # linear within the period
        inertia = self._robot.parameters["rotor_inertia"]
        self._battery.draw(inertia * (speed - speed_before) / DT * speed, DT)
        ahead, left, turn = self._distortion.imu(ax * cos + ay * sin, ay * cos - ax * sin, rate)
        voltage = None
        if self.time >= self._battery_due - DT / 2:
            self._battery_due += BATTERY_PERIOD
            voltage = self._battery.measure()
        return Readings(
            time=self.time,
            truth=Truth(
                (float(x), float(y), float(heading)),
                (float(vx * cos + vy * sin), float(vy * cos - vx * sin), float(rate)),
                tuple(float(v) for v in np.diff(after[2:size])),
            ),
            rotor=self._encoder.measure(self._rotor_angle, speed),
            imu=self._imu.measure((ahead, left), turn, float(heading), DT),
            camera=self._camera.update(self.time, x, y, heading),
            battery=voltage,
        )
