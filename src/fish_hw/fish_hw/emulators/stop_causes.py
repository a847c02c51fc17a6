# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Everything that must stop the rotor, as it happens to a LockstepRotor, and how long the stop may take."""

import math
import random
from collections.abc import Callable
from dataclasses import dataclass

from fish_hw.devices.rotor_driver import RUDDER
from fish_hw.emulators.lockstep_rotor import LockstepRotor
from fish_hw.emulators.vertiq import DRIVEN_MODES
from fish_hw.protocol import iquart
from fish_node.arming import CAMERA, DEADMAN, ESTOP, ODOMETRY, PAUSE

LIMIT_S = 0.35
DEAD_BATTERY_S = 1.2  # its voltage is filtered with battery_filter_s
MOVING = 0.5  # rad/s, a command that is not zero
FUSION_IMU_S, POSE_S = 0.1, 1 / 30  # fusion's imu_timeout; it says the loss with the next pose
TARGET_S = 0.15  # the controller's target_timeout
WAIT_S = 3.0

Cause = Callable[[LockstepRotor, random.Random], None]


def silence(name: str) -> Cause:
    """Something ceases to come."""
    return lambda robot, _: robot.silent.add(name)


def trouble(name: str, text: str) -> Cause:
    """Something says what is wrong with it; the rotor's node hears that at once."""

    def happen(robot: LockstepRotor, _: random.Random) -> None:
        robot.troubles[name] = text
        robot.driver.arming.heard(name, robot.clock.now, text)

    return happen


def module(**values: object) -> Cause:
    """A value of the module changes."""

    def happen(robot: LockstepRotor, _: random.Random) -> None:
        for name, value in values.items():
            setattr(robot.module, name, value)

    return happen


def unanswered(*registers: iquart.Register) -> Cause:
    """Questions for some registers (none given: for any) are not answered."""
    silent = {(register.type, register.param) for register in registers}

    def happen(robot: LockstepRotor, _: random.Random) -> None:
        robot.module.mangle = lambda reply: (
            b"" if not silent or (reply[2], reply[3]) in silent else reply
        )

    return happen


def _imu_lost(robot: LockstepRotor, chance: random.Random) -> None:
    delay = FUSION_IMU_S + chance.uniform(0.0, POSE_S)
    robot.at(delay, lambda: robot.troubles.update({ODOMETRY: "IMU lost"}))


def _planner_killed(robot: LockstepRotor, _: random.Random) -> None:
    """The controller says so; that its commands are at rest from then on is not counted on."""
    arming, text = robot.driver.arming, "controller: target is stale"
    robot.at(TARGET_S, lambda: arming.heard(PAUSE, robot.clock.now, text))


def _nan(robot: LockstepRotor, _: random.Random) -> None:
    robot.speed = lambda _: math.nan


def _speed_stuck(robot: LockstepRotor, _: random.Random) -> None:
    robot.module.frozen = (robot.module.velocity, robot.module.angle)


def _unplugged(robot: LockstepRotor, _: random.Random) -> None:
    robot.line.unplugged = True


def _brown_out(robot: LockstepRotor, _: random.Random) -> None:
    robot.module.reboot()


def _wet(robot: LockstepRotor, _: random.Random) -> None:
    robot.wire.low = True


def _operator(robot: LockstepRotor, _: random.Random) -> None:
    robot.driver.arming.disarm("disarmed by the operator")


def _sigterm(robot: LockstepRotor, _: random.Random) -> None:
    robot.driver.close()
    robot.dead = True


def _sigkill(robot: LockstepRotor, _: random.Random) -> None:
    robot.dead = True


CAUSES: dict[str, Cause] = {
    "commands cease (controller killed)": silence("joint_command"),
    "command is no number": _nan,
    "odometry ceases (fusion killed)": silence(ODOMETRY),
    "camera poses cease (camera or tracker killed)": silence(CAMERA),
    "IMU silent, said by fusion": _imu_lost,
    "target stale (planner killed)": _planner_killed,
    "coil at 90 deg C": module(coil_c=90.0),
    "controller at 90 deg C": module(controller_c=90.0),
    "module fault": module(faults=0b1000),
    "rotor jammed": module(jammed=True),
    "encoder stuck": _speed_stuck,
    "module silent": unanswered(),
    "speed and angle not answered": unanswered(iquart.OBS_VELOCITY, iquart.OBS_ANGLE),
    "battery and temperature not answered": unanswered(iquart.TELEMETRY),
    "faults not answered": unanswered(iquart.FAULT_NOW),
    "port unplugged": _unplugged,
    "module restarted (brown-out)": _brown_out,
    "battery too high": module(volts=4 * 4.5),
    "battery dead": module(volts=4 * 3.0),
    "water in the hull": _wet,
    "deadman released": trouble(DEADMAN, "the operator let the deadman go"),
    "deadman silent": silence(DEADMAN),
    "rudder output lost": trouble(RUDDER, "rudder: output lost"),
    "rudder silent (node killed)": silence(RUDDER),
    "emergency stop": trouble(ESTOP, "emergency stop is pressed"),
    "disarmed by the operator": _operator,
    "SIGTERM to node rotor": _sigterm,
    "SIGKILL to node rotor": _sigkill,
}


@dataclass(frozen=True)
class Stop:
    """One stop: s from the cause to the last command that was not zero, and until the module drives no more."""

    last_command_s: float
    coasting_s: float
    reason: str


def limit_s(cause: str) -> float:
    """How long the last command may come after the cause."""
    return DEAD_BATTERY_S if cause == "battery dead" else LIMIT_S


def stop(cause: str, seed: int) -> Stop:
    """Let a swimming robot have a cause at a random phase of its stroke, and see how it stops.

    Raises:
        RuntimeError: it did not swim before, or drives WAIT_S later.
    """
    chance = random.Random(seed)
    robot = LockstepRotor()
    robot.driver.connect()
    robot.run(2.5)  # the module counts its uptime in seconds
    if refusal := robot.arm():
        raise RuntimeError(f"{cause}: the robot was not armed: {refusal}")
    robot.run(2.0 + chance.uniform(0.0, 1.0))
    begin = robot.clock.now
    if not any(abs(v) > MOVING for t, v in robot.module.commanded_at if t > begin - 0.3):
        raise RuntimeError(f"{cause}: the robot did not swim before: {robot.driver.arming.reason}")
    CAUSES[cause](robot, chance)
    coasting = math.inf
    while robot.clock.now < begin + WAIT_S:
        robot.run(0.01)
        driven = robot.module.mode in DRIVEN_MODES
        coasting = math.inf if driven else min(coasting, robot.clock.now - begin)
    if math.isinf(coasting):
        raise RuntimeError(f"{cause}: the rotor is still driven after {WAIT_S:g} s")
    moving = [t for t, v in robot.module.commanded_at if abs(v) > MOVING]
    return Stop(max(moving[-1] - begin, 0.0), coasting, robot.driver.arming.reason)
