# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Arming, and another node of the same name."""

import math
import threading
from types import SimpleNamespace

import pytest
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.serialization import deserialize_message, serialize_message

from fish_node.arming import (
    AT_START,
    CAMERA,
    DEADMAN,
    ESTOP,
    ODOMETRY,
    OWNER,
    PAUSE,
    PAUSE_FORGOTTEN_S,
    Arming,
    ArmingSettings,
    Source,
    can_be_in_a_pool,
    can_be_swum,
    estimate_trouble,
    largest_of,
    operator_and_estimate,
)
from fish_node.nodes.arming import FORGOTTEN_S, ArmingListener, ArmingServer
from fish_node.rivals import Rivals

COMMAND = Source("joint_command", 0.15)
SETTINGS = ArmingSettings(deadman_timeout_s=0.3)


def ready(*more: Source) -> Arming:
    """Every source was heard at 0 s."""
    arming = Arming((COMMAND, *operator_and_estimate(SETTINGS), *more))
    for name in (COMMAND.name, ODOMETRY, CAMERA, DEADMAN):
        arming.heard(name, 0.0)
    return arming


def armed(*more: Source) -> Arming:
    arming = ready(*more)
    assert arming.arm(0.0) == ""
    return arming


def hear_all_but(arming: Arming, silent: str, now: float) -> None:
    for name in (COMMAND.name, ODOMETRY, CAMERA, DEADMAN):
        if name != silent:
            arming.heard(name, now)


def test_a_robot_is_disarmed_until_a_person_arms_it():
    arming = ready()
    assert not arming.check(0.0)
    assert arming.reason == AT_START
    assert arming.arm(0.0) == ""
    assert arming.check(0.1)
    assert (arming.reason, arming.count) == ("", 1)


def test_a_silence_that_ends_before_anybody_checks_disarms():
    arming = armed()
    hear_all_but(arming, "", 0.1)
    assert arming.check(0.1)
    hear_all_but(arming, "", 1.0)  # the process stood still
    assert not arming.check(1.0)
    assert arming.reason == "no joint_command for 0.15 s"


def test_a_trouble_that_ends_before_anybody_checks_disarms():
    arming = armed()
    for trouble in ("rudder: output lost", ""):
        arming.heard("word of the rudder", 0.01, trouble)
    assert not arming.check(0.01)
    assert arming.reason == "rudder: output lost"


def test_arming_is_refused_with_every_reason():
    arming = Arming((COMMAND, Source("rotor module")))
    arming.heard("rotor module", 0.0, "module faults: coil temperature")
    assert arming.arm(0.0) == "no joint_command yet; module faults: coil temperature"
    assert not arming.armed
    assert arming.count == 0


@pytest.mark.parametrize(
    ("silent", "limit_s"), [(COMMAND.name, 0.15), (ODOMETRY, 0.2), (CAMERA, 0.2), (DEADMAN, 0.3)]
)
def test_silence_of_a_source_disarms_after_its_timeout(silent, limit_s):
    arming, now = armed(), 0.0
    while arming.check(now):
        now += 0.01
        hear_all_but(arming, silent, now)
    assert now == pytest.approx(limit_s, abs=0.02)
    assert arming.reason == f"no {silent} for {limit_s:g} s"


@pytest.mark.parametrize(
    ("name", "trouble"),
    [
        ("rotor module", "coil at 90 deg C"),
        ("leak sensor", "leak: water in the hull"),
        (ESTOP, "emergency stop is pressed"),
        (DEADMAN, "the operator let the deadman go"),
    ],
)
def test_a_trouble_disarms_at_once_and_its_end_does_not_arm_again(name, trouble):
    arming = armed()
    arming.heard(name, 0.01, trouble)
    assert not arming.check(0.01)
    assert arming.reason == trouble
    assert trouble in arming.arm(0.02)  # refused while it lasts
    arming.heard(name, 0.03)
    assert not arming.check(0.03)
    assert arming.reason == trouble
    assert arming.arm(0.03) == ""
    assert arming.check(0.04)


@pytest.mark.parametrize("name", [ODOMETRY, PAUSE])
def test_a_doubt_that_passes_needs_no_person_and_one_that_lasts_is_latched(name):
    arming, now = armed(), 0.0
    for _ in range(20):  # twice as often doubted as not, each time anew
        now += 0.05
        hear_all_but(arming, name, now)
        arming.heard(name, now, "IMU lost")
        assert arming.check(now + 0.04)
        arming.heard(name, now + 0.04)
    begin = now = now + 0.05
    while arming.check(now):
        hear_all_but(arming, name, now)
        arming.heard(name, now, f"IMU lost for {now - begin:.2f} s")  # the words may change
        now += 0.01
    assert now - begin == pytest.approx(SETTINGS.pause_s, abs=0.011)
    assert arming.reason.startswith("IMU lost")
    assert "IMU lost" in arming.arm(now)  # no patience with it when a person arms
    arming.heard(name, now)
    assert not arming.check(now)
    assert arming.arm(now) == ""


def test_the_pause_of_a_node_that_is_gone_does_not_keep_the_robot_disarmed():
    arming = Arming(operator_and_estimate(ArmingSettings(estimate="ignored")))
    arming.heard(PAUSE, 0.0, "controller: target is stale")
    assert arming.arm(0.5) == "controller: target is stale"
    assert arming.arm(PAUSE_FORGOTTEN_S + 0.1) == ""


def test_the_first_reason_is_kept():
    arming = armed()
    arming.disarm("rotor jammed")
    arming.disarm("disarmed by the operator")
    assert not arming.check(5.0)
    assert arming.reason == "rotor jammed"


def test_what_is_only_watched_is_not_needed_but_disarms_when_it_ceases():
    settings = ArmingSettings(estimate="watched")
    arming = Arming(operator_and_estimate(settings))
    assert arming.arm(0.0) == ""
    assert arming.check(100.0)
    arming.heard(CAMERA, 100.0)
    assert arming.check(100.1)
    assert not arming.check(101.0)
    assert arming.reason == "no camera/pose for 0.2 s"
    assert arming.arm(102.0) == ""  # it is not waited for
    assert arming.check(200.0)


def test_an_ignored_estimate_has_no_say():
    sources = operator_and_estimate(ArmingSettings(estimate="ignored"))
    assert [source.name for source in sources] == [PAUSE, OWNER]


@pytest.mark.parametrize(
    ("pose", "twist", "plausible", "said"),
    [
        (0.1, 0.1, True, ""),
        (1e4, 0.1, True, "camera lost"),
        (0.1, 1e4, True, "IMU lost"),
        (math.nan, 0.1, True, "camera lost"),
        (0.1, 0.1, False, "not plausible"),
    ],
)
def test_what_fusion_does_not_vouch_for_is_lost(pose, twist, plausible, said):
    trouble = estimate_trouble(pose, twist, plausible, 1.0)
    assert said in trouble
    assert bool(trouble) == bool(said)


@pytest.mark.parametrize("bad", [-1.0, math.nan])
def test_a_variance_that_nobody_measured_vouches_for_nothing(bad):
    assert largest_of([0.5, 0.25, 0.0]) == 0.5
    assert "camera lost" in estimate_trouble(largest_of([0.1, bad, 0.1]), 0.1, True, 1.0)


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"estimate": "maybe"}, "estimate is 'maybe'"),
        ({"camera_timeout_s": math.nan}, "camera_timeout_s is nan, expected 0.05 to 5"),
        ({"deadman_timeout_s": -1.0}, "deadman_timeout_s is -1.0"),
    ],
)
def test_settings_that_cannot_be_are_refused(values, said):
    with pytest.raises(ValueError, match=said):
        ArmingSettings(**values)


def test_texts_of_other_nodes_can_do_no_harm():
    """A terminal obeys escape sequences, and a log of megabytes hides the rest."""
    arming = Arming()
    arming.arm(0.0)
    arming.disarm("\x1b[31mred\x07\nnext " + "x" * 5000)
    assert arming.reason.startswith("\\x1b[31mred\\x07\\nnext xxx")
    assert arming.reason.isprintable()
    assert len(arming.reason) < 500
    arming.heard("rudder", 1.0, "\x1b]0;title\x07")
    assert arming.arm(1.0) == "\\x1b]0;title\\x07"


def test_only_who_stays_is_a_rival():
    counts = [1, 2, 1, 2, 2, 2, 3, 1, 2, 2, 2]  # once a second
    times, warned = iter(range(len(counts))), []
    rivals = Rivals("/fish/x", lambda _: counts.pop(0), warned.append, lambda: float(next(times)))
    said = [rivals.warning() for _ in range(len(counts))]
    assert [bool(words) for words in said] == [False] * 5 + [True, True] + [False] * 3 + [True]
    assert said[5].startswith("another publisher of /fish/x")
    assert warned == [said[5]] * 2  # once for each


ROBOT, OTHER = "/fish/rotor 0123abcd", "/fish/simulator 4567cdef"


class ListenerBench:
    """An ArmingListener, and the words that reach it."""

    def __init__(self) -> None:
        self.now, self.calls = 100.0, 0
        node = SimpleNamespace(create_subscription=self._subscribe)
        self.listener = ArmingListener(node, self._on_state, lambda: self.now)

    def _subscribe(self, kind, topic, callback, depth, raw):
        self._hear = callback

    def _on_state(self) -> None:
        self.calls += 1

    def say(self, *words: tuple[str, bool]) -> None:
        """One message: (owner, armed) of each status."""
        levels = {True: DiagnosticStatus.OK, False: DiagnosticStatus.WARN}
        status = [
            DiagnosticStatus(level=levels[ok], message="armed" if ok else "a leak", hardware_id=who)
            for who, ok in words
        ]
        self._hear(serialize_message(DiagnosticArray(status=status)))


@pytest.mark.parametrize("together", [True, False])
def test_one_owner_that_says_armed_does_not_overrule_another_that_says_disarmed(together):
    bench = ListenerBench()
    for _ in range(10):
        if together:
            bench.say((ROBOT, False), (OTHER, True))
        else:
            bench.say((ROBOT, False))
            bench.say((OTHER, True))
        bench.now += 0.05
        assert bench.listener.armed is False
        said = "/fish/rotor and /fish/simulator say arming/state: stop one of the two"
        assert bench.listener.reason.startswith(said)
        assert bench.listener.reason.endswith("; a leak")


def test_an_owner_that_is_gone_has_no_say():
    bench = ListenerBench()
    bench.say((ROBOT, False))
    assert (bench.listener.armed, bench.listener.reason) == (False, "a leak")
    bench.now += FORGOTTEN_S + 0.01
    bench.say((OTHER, True))
    assert (bench.listener.armed, bench.listener.reason) == (True, "")
    bench.say((ROBOT, True))
    assert bench.listener.armed is True


def test_an_owner_that_says_both_in_one_message_says_disarmed():
    bench = ListenerBench()
    bench.say((ROBOT, False), (ROBOT, True))
    assert (bench.listener.armed, bench.listener.reason) == (False, "a leak")


def test_a_message_without_a_status_is_no_word():
    bench = ListenerBench()
    bench.say()
    assert (bench.listener.armed, bench.calls) == (None, 0)
    bench.say((ROBOT, True))
    for _ in range(3):
        bench.say()
    assert (bench.listener.armed, bench.calls) == (True, 1)


class Owner:
    """Stands for the node that owns a state; publishing takes until the test lets it end."""

    def __init__(self, arming: Arming) -> None:
        self.sent: list[DiagnosticStatus] = []
        self.inside = self.most = 0
        self.second = threading.Event()  # a second message is sent while the first one is
        self.patience_s = 0.0
        self.server = ArmingServer(self, arming, ArmingSettings(estimate="ignored"), lambda: 0.0)

    def get_fully_qualified_name(self) -> str:
        return "/fish/rotor"

    def get_clock(self):
        return SimpleNamespace(now=lambda: SimpleNamespace(to_msg=Time))

    def get_logger(self):
        return SimpleNamespace(info=lambda _: None, warning=lambda _: None)

    def create_publisher(self, *_):
        return SimpleNamespace(publish=self._send)

    def create_service(self, *_, **__) -> None:
        """Nobody calls it."""

    create_subscription = create_timer = create_service

    def _send(self, data: bytes) -> None:
        self.inside += 1
        self.most = max(self.most, self.inside)
        if self.inside > 1:
            self.second.set()
        self.second.wait(self.patience_s)
        self.sent += deserialize_message(data, DiagnosticArray).status
        self.inside -= 1


class Torn(Arming):
    """An emergency stop comes right after somebody looked whether the robot is armed."""

    @property
    def armed(self) -> bool:
        armed = self._armed
        self.disarm("estop")
        return armed


def test_a_stop_while_the_state_is_published_is_not_said_of_an_armed_robot():
    arming = Torn()
    arming.arm(0.0)
    owner = Owner(arming)
    owner.server.publish()
    arming.disarm("estop")
    owner.server.publish()
    said = [(status.level, status.message) for status in owner.sent]
    assert said == [(DiagnosticStatus.OK, "armed"), (DiagnosticStatus.WARN, "estop")]


def test_two_threads_publish_the_state_one_after_the_other():
    owner = Owner(Arming())
    owner.patience_s = 0.3
    threads = [threading.Thread(target=owner.server.publish) for _ in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert (len(owner.sent), owner.most) == (2, 1)


def test_a_state_that_was_never_heard_forbids_to_move_where_one_is_required():
    bench = ListenerBench()
    assert bench.listener.forbids(required=True).startswith("no arming/state yet")
    assert bench.listener.forbids(required=False) == ""
    bench.say((ROBOT, False))
    assert bench.listener.forbids(required=True) == bench.listener.forbids(required=False)
    bench.say((ROBOT, True))
    assert bench.listener.forbids(required=True) == ""


def test_an_owner_that_fell_silent_forbids_to_move_where_one_is_required():
    bench = ListenerBench()
    bench.say((ROBOT, True))
    bench.now += FORGOTTEN_S + 0.01
    assert bench.listener.forbids(required=True).startswith("no arming/state for 1 s")
    assert bench.listener.forbids(required=False) == ""


@pytest.mark.parametrize(
    ("x", "w", "plausible"),
    [
        (0.5, 1.0, True),
        (1e300, 1.0, False),
        (math.nan, 1.0, False),
        (0.5, 0.0, False),
        (0.5, math.nan, False),
    ],
)
def test_a_place_that_no_fish_can_have_is_no_estimate(x, w, plausible):
    assert can_be_in_a_pool(x, 0.0, 0.0, w) is plausible


@pytest.mark.parametrize("rate", [51.0, -1e300, math.inf, math.nan])
def test_a_speed_that_no_fish_can_have_is_no_estimate(rate):
    assert can_be_swum((0.3, 0.0, -2.0))
    assert not can_be_swum((0.3, rate, -2.0))
