# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Random faults of a LockstepRobot, one after the other, and what must never happen meanwhile."""

import itertools
import math
import traceback
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

from fish_hw.emulators.lockstep_robot import LockstepRobot
from fish_hw.emulators.lockstep_rotor import DT

RAMP_S = 0.13  # s, in which a disarmed rotor is at rest: ramp_s and a late cycle
ARMED_WITHIN_S = 30.0  # s; a lost device is looked for every 5 s
SWIMS_WITHIN_S = 2.0
AT_REST = 1e-6  # rad/s
ROUNDING = 0.01  # rad/s, of single precision
SILENCE_S = 0.25  # s without a command, after which the module coasts by itself: module_timeout_s
LATE = 1.5  # periods, that a late cycle earns


@dataclass
class Counts:
    """What was done, and what went wrong."""

    done: Counter[str] = field(default_factory=Counter)
    disarmed: Counter[str] = field(default_factory=Counter)
    crashes: list[str] = field(default_factory=list)
    moved_disarmed: int = 0
    over_limits: int = 0
    not_recovered: list[str] = field(default_factory=list)

    @property
    def failed(self) -> bool:
        """Whether anything happened that must not."""
        return bool(self.crashes or self.moved_disarmed or self.over_limits or self.not_recovered)


class FaultRun:
    """A robot, its faults, and the counts.

    Attributes:
        robot: swims, or is broken.
        counts: of all faults so far.

    Args:
        folder: for the robot's files.
        seed: of the choice of faults and of all noise.
    """

    def __init__(self, folder: Path, seed: int = 0) -> None:
        self.robot = LockstepRobot(folder, seed)
        self.counts = Counts()
        self._run(3.0)

    def fault(self, name: str = "") -> None:
        """Let a fault happen to the swimming robot, mend it, arm the robot and see it swim; none named: a random one."""
        self._happen(name or self.robot.chance.choice(sorted(self.robot.faults)))
        self._judge()

    def _happen(self, name: str) -> None:
        robot, chance = self.robot, self.robot.chance
        if not self._swim_again():
            self.counts.not_recovered.append(f"before {name}")
            return
        self._run(chance.uniform(0.3, 1.0))
        self.counts.done[name] += 1
        robot.faults[name]()
        self._run(chance.uniform(1.0, 3.0))
        if name == "kill rotor" or not robot.driver.arming.armed:
            self.counts.disarmed[name] += 1
        robot.mend()
        self._run(0.3)
        if not self._swim_again():
            self.counts.not_recovered.append(f"{name}: {robot.driver.arming.reason}")

    def _swim_again(self) -> bool:
        robot = self.robot
        end = robot.clock.now + ARMED_WITHIN_S
        while not robot.driver.arming.armed and robot.clock.now < end:
            robot.arm()
            self._run(0.1)
        end = robot.clock.now + SWIMS_WITHIN_S
        while not robot.swims and robot.clock.now < end:
            self._run(DT)
        return robot.driver.arming.armed and robot.swims

    def _run(self, duration_s: float) -> None:
        robot = self.robot
        end = robot.clock.now + duration_s
        while robot.clock.now < end:
            try:
                robot.run(DT)
            except Exception:
                self.counts.crashes.append(traceback.format_exc(limit=-3))
                return

    def _judge(self) -> None:
        """Count what moved while it must not, and what moved too far or too fast; what was judged is forgotten."""
        robot, settings = self.robot, self.robot.settings
        sent = robot.module.commanded_at
        most = settings.max_acceleration * LATE / settings.rate_hz + ROUNDING
        self.counts.moved_disarmed += moved_while_disarmed(robot.states, sent)
        self.counts.over_limits += (
            sum(abs(v) > settings.max_velocity + ROUNDING for _, v in sent)
            + sum(change > most for change in speed_changes(sent))
            + self._rudder_over_limits()
        )
        for record in (sent, robot.states, robot.angles):
            del record[:-1]

    def _rudder_over_limits(self) -> int:
        servo, angles = self.robot.servo, self.robot.angles
        most = servo.max_rate * 0.05 + 0.002  # rad, of a cycle that was late
        return sum(abs(a) > servo.max_angle + 0.002 for _, a in angles) + sum(
            abs(b - a) > most for (_, a), (_, b) in itertools.pairwise(angles)
        )


def speed_changes(sent: list[tuple[float, float]]) -> list[float]:
    """Changes [rad/s] away from rest between commands; after a silence of SILENCE_S the rotor coasted, and rest was before.

    Args:
        sent: s, and rad/s, in order.
    """
    changes = []
    for (before_s, before), (time_s, speed) in itertools.pairwise(sent):
        from_speed = before if time_s - before_s < SILENCE_S else 0.0
        changes.append(abs(speed - from_speed) if abs(speed) > abs(from_speed) else 0.0)
    return changes


def moved_while_disarmed(states: list[tuple[float, bool]], sent: list[tuple[float, float]]) -> int:
    """Speed commands that are not zero, later than RAMP_S after the robot was disarmed and before it was armed again.

    Args:
        states: s, and whether the robot was armed, in order.
        sent: s, and rad/s, in order.
    """
    count, disarmed_s = 0, math.inf
    events = sorted([*((t, 0, float(armed)) for t, armed in states), *((t, 1, v) for t, v in sent)])
    for time_s, kind, value in events:
        if kind == 0:
            disarmed_s = math.inf if value else min(disarmed_s, time_s)
        elif abs(value) > AT_REST and time_s > disarmed_s + RAMP_S:
            count += 1
    return count
