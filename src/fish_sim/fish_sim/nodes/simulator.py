# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The simulated fish in its pool: what the robot's drivers would publish, and the truth.

In: joint_command (sensor_msgs/JointState, names rotor and rudder; rotor: velocity in rad/s, rudder: position
in rad). Out, 100 Hz: joint_states (rotor encoder), imu/data, sim/odometry (nav_msgs/Odometry, the truth,
pool -> base_link), sim/joint_states (tail_1 .. relative angles, rad), /clock; 1 Hz: battery_state,
/diagnostics; with camera:=pose also camera/pose, on which alone the robot file's camera effects act. Services: arm
(SetBool), pause (SetBool), reset (Trigger).

Rotor and rudder move only while the robot is armed. The node owns the arming state (fish_node.nodes.arming) as node rotor
does on the robot; its clock is the simulated time.

With `walls` the head's centre stops at the pool's edge: one line on the console for each contact, and on /diagnostics
wall_contacts.

Time on /clock and in stamps starts at the wall clock's and runs real_time_factor times as fast, so that other
nodes may use either clock at factor 1. Without use_sim_time it returns to the wall clock's after a pause, and after a step
of the wall clock.
With lockstep it stands still while joint_command, or anybody else who says how far he is (lockstep_topics), is behind it
(Lockstep), so that a run does not depend on how busy the computer is.
"""

import math
import time

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import PoseWithCovarianceStamped
from nav_msgs.msg import Odometry
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock as ClockMessage
from sensor_msgs.msg import BatteryState, Imu, JointState
from std_msgs.msg import Header
from std_srvs.srv import SetBool, Trigger

from fish_node.arming import Arming, Source, operator_and_estimate
from fish_node.nodes.arming import ArmingServer
from fish_node.nodes.start import read_parameters, run
from fish_node.nodes.status_log import StatusLog
from fish_node.rivals import Rivals
from fish_sim.model import DT
from fish_sim.nodes import simulator_messages as messages
from fish_sim.nodes.lockstep_topics import hear_lockstep
from fish_sim.nodes.pacing import MAX_LAG, Lockstep, Pacer
from fish_sim.nodes.simulator_messages import health
from fish_sim.robot import Robot
from fish_sim.robot_file import load_robot
from fish_sim.simulation import Readings, Simulation
from fish_sim.simulation_config import SimulatorConfig

QUEUE = 10
RESENT = 1000  # messages that lockstep keeps for a recorder that lags: 10 s
SAY_AGAIN = 0.5  # s of real time that lockstep waits before it says the newest IMU sample again
CLOCK_AGAIN = 0.1  # s of real time, likewise of /clock: every node wakes up for it, and a busy computer would be busier
WAIT_SAID = 1.0  # s of real time that lockstep waits before it says for whom
COMMAND = "joint_command"  # source of the arming state


class SimulatorNode(Node):
    """Messages in and out; physics and sensors are in Simulation, the pace in Pacer."""

    def __init__(self) -> None:
        super().__init__(
            "simulator", namespace="fish", automatically_declare_parameters_from_overrides=True
        )
        self._config = config = read_parameters(self, SimulatorConfig)
        robot = load_robot(config.robot_file) if config.robot_file else Robot()
        if idle := config.idle_sensors(robot.sensors):
            self.get_logger().warning(idle)
        self._simulation = Simulation(robot, config)
        self._follows_wall = (
            config.real_time_factor == 1.0
            and not config.lockstep
            and not self.get_parameter("use_sim_time").value
        )
        command = Source(COMMAND, config.command_timeout + config.pause_s)  # the rotor rests before
        self._arming = Arming((command, *operator_and_estimate(config)))
        self._paused = config.paused
        self._frames = (
            config.pool_frame,
            config.frame_prefix + config.body_frame,
            config.frame_prefix + config.imu_frame,
        )
        self._refused = self._divergences = self._contacts = 0
        self._refusal = ""
        self._lockstep = Lockstep(config.lockstep, config.lockstep_slack)
        self._out = messages.PeriodMessages(self._frames, robot.links, config)
        self._felt: bytes | None = None  # newest sample
        self._felt_said = self._clock_said = 0.0  # s of real time
        self._create_interfaces(config.camera == "pose")
        self._start_ns = time.time_ns()
        self._pacer = Pacer(config.real_time_factor, DT, time.monotonic())
        self._reported = (time.monotonic(), self._simulation.time, 0.0)
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(
            DT / config.real_time_factor if config.real_time_factor else 0.0,
            self._tick,
            clock=steady,
        )
        self.create_timer(1.0, self._report, clock=steady)

    def _create_interfaces(self, camera_pose: bool) -> None:
        clock_qos = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
        self._clock_publisher = self.create_publisher(ClockMessage, "/clock", clock_qos)
        kept = RESENT if self._config.lockstep else QUEUE
        self._joints = self.create_publisher(JointState, "joint_states", kept)
        self._imu = self.create_publisher(Imu, "imu/data", kept)
        self._odometry = self.create_publisher(Odometry, "sim/odometry", kept)
        self._tail = self.create_publisher(JointState, "sim/joint_states", kept)
        self._battery = self.create_publisher(BatteryState, "battery_state", QUEUE)
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", QUEUE)
        self._log = StatusLog(self.get_logger())
        self._rivals = [
            Rivals(publisher.topic_name, self.count_publishers, self.get_logger().warning)
            for publisher in (self._odometry, self._clock_publisher)
        ]
        self._camera = None
        if camera_pose:
            self._camera = self.create_publisher(PoseWithCovarianceStamped, "camera/pose", QUEUE)
        self.create_subscription(JointState, "joint_command", self._on_command, QUEUE)
        if self._config.lockstep:
            hear_lockstep(self, self._lockstep, self._simulated, self._config.lockstep_camera)
        self._armed = ArmingServer(
            self,
            self._arming,
            self._config,
            lambda: self._simulation.time,
            lambda: self._stamp(self._simulation.time),
        )
        self.create_service(SetBool, "pause", self._on_pause)
        self.create_service(Trigger, "reset", self._on_reset)

    def _on_command(self, msg: JointState) -> None:
        try:
            speed, rudder = messages.command(msg)
            if not (math.isfinite(speed) and math.isfinite(rudder)):
                self._arming.disarm(f"commanded {speed} rad/s and {rudder} rad, expected numbers")
            self._simulation.command(speed, rudder)
            self._arming.heard(COMMAND, self._simulation.time)
        except ValueError as error:
            self._refused += 1
            self._refusal = str(error)
        self._lockstep.answered("joint_command", self._simulated(msg.header.stamp))

    def _on_pause(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        if self._paused and not request.data:
            self._restart_pace()
        self._paused = request.data
        response.success, response.message = True, "paused" if self._paused else "running"
        return response

    def _on_reset(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self._simulation.reset()
        response.success, response.message = True, "at rest at the start pose; time goes on"
        return response

    def _restart_pace(self) -> None:
        self._pacer.restart(time.monotonic())
        if self._follows_wall:
            self._start_ns = time.time_ns() - round(self._simulation.time * 1e9)

    def _tick(self) -> None:
        if self._paused:
            return
        if not self._lockstep.may_advance(self._simulation.time, time.monotonic()):
            self._restart_pace()
            self._say_again()
            return
        lost = self._pacer.lost
        periods = self._pacer.due(time.monotonic())
        if self._pacer.lost > lost:
            self._restart_pace()
            return
        if self._wall_stepped(periods):
            self.get_logger().warning("the wall clock was set: simulated time follows it")
            self._restart_pace()
            return
        for _ in range(min(periods, 1) if self._config.lockstep else periods):
            self._simulation.follow(self._arming.check(self._simulation.time))
            self._armed.say_change()
            try:
                self._publish(self._simulation.advance())
            except FloatingPointError as error:
                self._divergences += 1
                self.get_logger().error(str(error))
            self._say_contact()

    def _say_again(self) -> None:
        """Who missed the newest message, which nobody sends again, would wait for the time that waits for it."""
        now = time.monotonic()
        if min(self._lockstep.waited(now), now - self._clock_said) > CLOCK_AGAIN:
            self._clock_said = now
            self._clock_publisher.publish(self._out.clock(self._stamp(self._simulation.time)))
        if (
            self._felt is not None
            and min(self._lockstep.waited(now), now - self._felt_said) > SAY_AGAIN
        ):
            self._felt_said = now
            self._imu.publish(self._felt)

    def _say_contact(self) -> None:
        """One line for each contact with a wall."""
        walls = self._simulation.walls
        if walls.contacts > self._contacts:
            self._contacts = walls.contacts
            x, y = walls.place
            self.get_logger().warning(
                f"the fish came to the pool's wall at ({x:.2f}, {y:.2f}) m and stops there: contact {walls.contacts}"
            )

    def _wall_stepped(self, periods: int) -> bool:
        """Whether simulated time, once it has run `periods`, is not the wall clock's though it should be.

        The pace is that of a clock which is never set: one that NTP corrects after the start had been left behind for ever,
        and every other node called the stamps stale.
        """
        if not self._follows_wall:
            return False
        due_ns = self._start_ns + round((self._simulation.time + periods * DT) * 1e9)
        return abs(time.time_ns() - due_ns) > MAX_LAG * 1e9

    def _stamp(self, simulated: float) -> Time:
        seconds, nanoseconds = divmod(self._start_ns + round(simulated * 1e9), 1_000_000_000)
        return Time(sec=seconds, nanosec=nanoseconds)

    def _simulated(self, stamp: Time) -> float:
        """Simulated time [s] of a stamp; a message without one is of now."""
        if stamp == Time():
            return self._simulation.time
        return 1e-9 * float(stamp.sec * 1_000_000_000 + stamp.nanosec - self._start_ns)

    def _publish(self, readings: Readings) -> None:
        stamp = self._stamp(readings.time)
        self._clock_publisher.publish(self._out.clock(stamp))
        self._tail.publish(self._out.tail(stamp, readings.truth))
        self._odometry.publish(self._out.odometry(stamp, readings.truth))
        self._joints.publish(self._out.rotor(stamp, readings.rotor))
        self._felt = self._out.imu(stamp, readings.imu)
        self._felt_said = time.monotonic()
        self._imu.publish(self._felt)
        if readings.battery is not None:
            header = Header(stamp=stamp, frame_id=self._frames[1])
            self._battery.publish(messages.battery(header, readings.battery))
        if self._camera is not None:
            for sample in readings.camera:
                header = Header(stamp=self._stamp(sample.stamp), frame_id=self._frames[0])
                self._camera.publish(messages.camera_pose(header, sample, self._config))

    def _report(self) -> None:
        """Diagnostics, once a second."""
        now, simulated, lost = time.monotonic(), self._simulation.time, self._pacer.lost
        then, simulated_then, lost_then = self._reported
        self._reported = (now, simulated, lost)
        pace = (simulated - simulated_then) / (now - then)
        waits = self._lockstep.waited(now) > WAIT_SAID
        level, text = health(
            self._divergences,
            self._refusal,
            self._paused,
            lost - lost_then,
            self._lockstep.awaited if waits else "",
            pace,
            self._config.real_time_factor,
            "" if self._arming.armed else self._arming.reason,
        )
        self._log.say(level, text)
        warnings = [rivals.warning() for rivals in self._rivals]
        if self._simulation.walls.touches(simulated):
            warnings.append("the fish is at the pool's wall")
        for warning in filter(None, warnings):
            level, text = max(level, DiagnosticStatus.WARN), f"{text}; {warning}"
        values = {
            "real_time_factor": f"{pace:.3f}",
            "simulated_s": f"{simulated:.2f}",
            "lost_s": f"{lost:.2f}",
            "command_age_s": f"{self._simulation.command_age:.2f}",
            "commands_refused": str(self._refused),
            "resets": str(self._simulation.resets),
            "divergences": str(self._divergences),
            "wall_contacts": str(self._simulation.walls.contacts),
        }
        name, header = self.get_fully_qualified_name(), Header(stamp=self._stamp(simulated))
        status = messages.status(name.lstrip("/"), level, text, values)
        self._diagnostics.publish(DiagnosticArray(header=header, status=[status]))
        self._refusal = ""


def main() -> int:
    """Entry point."""
    return run(SimulatorNode, "simulator")


if __name__ == "__main__":
    raise SystemExit(main())
