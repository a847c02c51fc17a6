# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Random faults while the robot swims through the real drivers on a fake robot: crashes, forbidden motion, recoveries.

    python benchmarks/fault_campaign.py [--faults 500] [--seed 0] [--real-time-factor 0.7] [--out folder]

For each fault the robot is armed and swims open loop; a device is broken or a node is killed, and mended or started again after
a while. Counted: nodes that ended by themselves, rotor commands while disarmed, commands over the limits, robots that could not
be armed again. Status 1 if any count is not zero. All times are the robot's; simulated time runs as fast as the computer can
keep, and waits for nodes that lag. Ctrl-C ends the campaign with the counts so far.
"""

from __future__ import annotations

import argparse
import contextlib
import math
import random
import signal
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import Header, String

from fish_bringup.node_table import CONTROL, FAKE, LAGS, REAL, NodeSpec, fake_parameters
from fish_bringup.nodes.watch import WatchNode, seconds, watching
from fish_bringup.processes import NodeProcesses
from fish_node.domain import choose_domain

ROTOR, RUDDER, IMU, CAMERA = REAL
TRACKER, FUSION, *_ = CONTROL
NODES = (*FAKE, *REAL, TRACKER, FUSION)
KILLED = (ROTOR, RUDDER, IMU, CAMERA, TRACKER, FUSION)
FAULTS = (
    "rotor unplug", "rotor garbage", "rotor crc", "rotor silent", "rotor reboot", "rotor jam", "rotor stuck",
    "rotor hot", "rotor fault", "imu unplug", "imu errors", "imu gone", "imu reset", "imu frozen", "imu bits",
    "imu step", "camera unplug", "camera frozen", "rudder off",
)  # fmt: off
AMPLITUDE, FREQUENCY = 60.0, 2.0 * np.pi * 2.0  # rad/s, rad/s
LIMIT = 160.0  # rad/s, max_velocity of rotor.yaml
STOPPED_S = 0.5  # s after the disarming, within which the rotor must be at rest
STILL = 20.0  # rad/s; the rotor has an inertia of its own
ARMED_WITHIN_S = 60.0
LOOK_S = 0.05  # s of real time
STANDS_S = 60.0  # s of real time without a word of the fake robot
PATIENCE_S = 2.0  # s of real time that simulated time waits for who was silenced by a fault
KEPT = 1000  # messages that wait for a busy computer


@dataclass
class Counts:
    """What went wrong, and what was done."""

    done: Counter[str] = field(default_factory=Counter)
    crashes: list[str] = field(default_factory=list)
    moved_disarmed: int = 0
    over_limits: int = 0
    not_armed: list[str] = field(default_factory=list)
    not_disarmed: Counter[str] = field(default_factory=Counter)

    @property
    def failed(self) -> bool:
        """Whether anything happened that must not."""
        return bool(self.crashes or self.moved_disarmed or self.over_limits or self.not_armed)


class Campaign:
    """The robot and what is watched of it."""

    def __init__(
        self,
        nodes: NodeProcesses,
        watch: WatchNode,
        listen: Callable[[float], None],
        parameters: dict[NodeSpec, dict[str, object]],
    ) -> None:
        self.counts = Counts()
        self._nodes, self._watch, self._listen = nodes, watch, listen
        self._parameters = parameters
        peer: Node = watch
        self._command = peer.create_publisher(JointState, "joint_command", 1)
        self._fault = peer.create_publisher(String, "fake/fault", 10)
        self._now = 0.0  # s, the robot's time
        self._states: list[tuple[float, bool]] = []  # s, stamp; whether armed
        self._motion: list[tuple[float, float]] = []  # s, stamp; rad/s
        peer.create_subscription(JointState, "fake/joint_command", self._on_motion, KEPT)
        peer.create_subscription(DiagnosticArray, "arming/state", self._on_state, KEPT)

    def start(self, spec: NodeSpec) -> None:
        """Start a node, or start it again."""
        self._nodes.start(spec, self._parameters.get(spec))

    def fault(self, name: str, lasts_s: float) -> None:
        """Arm, let a fault happen, mend it."""
        if not self._arm():
            self.counts.not_armed.append(f"before {name}: {self._watch.refusal}")
            return
        self.listen(random.uniform(0.5, 1.5))
        self.counts.done[name] += 1
        killed = next((spec for spec in KILLED if name == f"kill {spec.name}"), None)
        if killed is not None:
            process = self._nodes.running[killed]
            process.signal(signal.SIGKILL)
            process.wait(5.0)
        else:
            self._fault.publish(String(data=name))
        self.listen(lasts_s)
        if not self._watch.disarmed:
            self.counts.not_disarmed[name] += 1
        if killed is not None:
            self.start(killed)
        self._fault.publish(String(data="mend"))
        self.listen(0.3)
        for process in self._nodes.ended():
            self.counts.crashes.append(f"{name}: {process.spec.name}: {process.last_words()}")
            self.start(process.spec)

    def listen(self, seconds: float) -> None:
        """Listen for so many seconds of the robot's time."""
        begin, since = self._now, time.monotonic()
        while self._now < begin + seconds and time.monotonic() < since + STANDS_S:
            before = self._now
            self._listen(LOOK_S)
            since = time.monotonic() if self._now > before else since

    def _arm(self) -> bool:
        end = self._now + ARMED_WITHIN_S
        while self._watch.disarmed != "" and self._now < end:
            self._watch.ask_to_arm()
            self.listen(0.1)
        return bool(self._watch.disarmed == "")

    def _swim(self, header: Header) -> None:
        """A command for every word of the fake robot."""
        message = JointState(name=["rotor", "rudder"])
        message.header.stamp = header.stamp
        speed = AMPLITUDE * float(np.sin(FREQUENCY * self._now))
        message.velocity, message.position = [speed, 0.0], [0.0, 0.2]
        self._command.publish(message)

    def _on_state(self, message: DiagnosticArray) -> None:
        armed = message.status[0].level == DiagnosticStatus.OK
        self._states.append((seconds(message.header), armed))

    def _on_motion(self, message: JointState) -> None:
        self._now = seconds(message.header)
        self._motion.append((self._now, abs(message.velocity[0])))
        self._swim(message.header)

    def judge(self) -> None:
        """Count what moved too fast, or while disarmed; by stamps, as a busy computer delivers late."""
        self.counts.over_limits += sum(speed > LIMIT for _, speed in self._motion)
        self.counts.moved_disarmed += moved_while_disarmed(self._states, self._motion)


def moved_while_disarmed(
    states: list[tuple[float, bool]], motion: list[tuple[float, float]]
) -> int:
    """Samples of motion later than STOPPED_S after the robot was disarmed, and before it was armed again.

    Motion after the last state is not judged: a busy computer hears some topics later than others.

    Args:
        states: stamp [s] and whether the robot was armed, in order.
        motion: stamp [s] and speed of the rotor [rad/s].
    """
    count, disarmed_at = 0, math.inf
    last = states[-1][0] if states else -math.inf
    moved = [(t, 1, speed) for t, speed in motion if t < last]
    events = sorted([*((t, 0, armed) for t, armed in states), *moved])
    for time_s, kind, value in events:
        if kind == 0:
            disarmed_at = math.inf if value else min(disarmed_at, time_s)
        elif value > STILL and time_s > disarmed_at + STOPPED_S:
            count += 1
    return count


def on_a_slow_clock(
    parameters: dict[NodeSpec, dict[str, object]], factor: float
) -> dict[NodeSpec, dict[str, object]]:
    """The nodes' parameters with simulated time that runs `factor` times as fast as real time and waits for who lags."""
    slowed = {spec: {**parameters.get(spec, {}), "use_sim_time": True} for spec in NODES}
    slowed[FAKE[1]] |= {"real_time_factor": factor, **LAGS, "lockstep": PATIENCE_S}
    return slowed


def main() -> int:
    """Run the campaign and print the counts."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--faults", type=int, default=500, help="how many (500)")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--domain", type=int, help="ROS domain (a free one)")
    parser.add_argument(
        "--real-time-factor",
        type=float,
        default=0.7,
        help="simulated seconds in a second, where the computer can keep it (0.7)",
    )
    parser.add_argument("--out", type=Path, default=Path("out/fault_campaign"), help="logs")
    args = parser.parse_args()
    random.seed(args.seed)
    names = [*FAULTS, *(f"kill {spec.name}" for spec in KILLED)]
    domain = choose_domain(args.domain)
    with (
        tempfile.TemporaryDirectory(prefix="fish_") as devices,
        NodeProcesses(domain, args.out) as nodes,
        watching(domain) as (watch, listen),
    ):
        parameters = on_a_slow_clock(fake_parameters(Path(devices)), args.real_time_factor)
        campaign = Campaign(nodes, watch, listen, parameters)
        for spec in NODES:
            campaign.start(spec)
        with contextlib.suppress(KeyboardInterrupt):
            campaign.listen(1e-3)  # until the fake robot speaks
            campaign.listen(3.0)
            for k in range(args.faults):
                name = random.choice(names)
                campaign.fault(name, random.uniform(1.0, 3.0))
                print(f"{k + 1:4} {name:28} {watch.disarmed or 'armed'}", flush=True)
        campaign.judge()
    counts = campaign.counts
    print(f"{counts.done.total()} faults: {dict(counts.done)}")
    print(f"nodes that ended by themselves: {len(counts.crashes)} {counts.crashes}")
    print(f"samples of motion while disarmed: {counts.moved_disarmed}")
    print(f"samples over {LIMIT:g} rad/s: {counts.over_limits}")
    print(f"could not be armed again: {len(counts.not_armed)} {counts.not_armed}")
    print(f"not disarmed within the fault's time: {dict(counts.not_disarmed)}")
    return 1 if counts.failed else 0


if __name__ == "__main__":
    sys.exit(main())
