# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""How a watched run ends, with a fish that moves along its path whenever somebody listens."""

import os
import signal
import time
from contextlib import contextmanager, nullcontext
from types import SimpleNamespace

import numpy as np
import pytest
from rich.console import Console

from fish_bringup.node_table import ROBOTS, NodeSpec
from fish_bringup.run_limits import LONGEST_WITHOUT_CAMERA, Seen
from fish_bringup.run_watch import FUSION, Robot, Sight
from fish_bringup.verbs import excite
from fish_control.excursions import Excursion
from fish_control.path_tracker import PathTracker
from fish_control.paths import make_path
from fish_control.pool import HALF_LENGTH
from fish_report.errors import UserError
from fish_report.interruption import Interruption

SWIM = Excursion(0.0, 8.0, 0.0, 0.0, 0.0)
NODE = NodeSpec("test", "node", "none.yaml")


class Fish:
    """Swims along a path at 0.2 m/s of its own time, which passes while somebody listens."""

    def __init__(self, path):
        self.path, self.tracker, self.time = path, PathTracker(path), 0.0
        self.events = {}  # s of its time -> something that happens
        self.disarmed, self.refusal, self.asked = "not armed since the start", "it is too hot", 0

    def ask_to_arm(self):
        """It is armed at the third request."""
        self.asked += 1
        if self.asked == 3:
            self.disarmed = ""

    @property
    def sight(self):
        x, y = self.path.point(0.2 * self.time)
        return Sight(self.time, float(x), float(y), 0.0, 0.2)

    @property
    def seen(self):
        """By a camera of 30 Hz, 50 ms late."""
        stamp = np.floor(30.0 * max(self.time - 0.05, 0.0)) / 30.0
        x, y = self.path.point(0.2 * stamp)
        return Seen(stamp, float(x), float(y))

    def listen(self, seconds):
        self.time += seconds
        for when in [when for when in self.events if when <= self.time]:
            self.events.pop(when)()


@pytest.fixture
def nodes():
    """Nodes that run on."""
    running = {FUSION: SimpleNamespace(log="logs/fusion.log")}
    return SimpleNamespace(cpu_times=lambda: {NODE: 1.0}, ended=lambda: [], running=running)


@pytest.fixture
def interruption():
    with Interruption() as interruption:
        yield interruption


def swim(fish, nodes, interruption, duration=600.0):
    return Robot(nodes, fish, fish.listen, interruption).swim(duration, Console(quiet=True))


def test_a_simulated_robot_is_asked_until_it_is_armed(nodes, interruption):
    fish = Fish(make_path("straight", length=2.0))
    Robot(nodes, fish, fish.listen, interruption).arm()
    assert (fish.disarmed, fish.asked) == ("", 3)


def test_a_robot_that_is_disarmed_on_the_way_is_armed_again_and_it_is_said(
    nodes, interruption, capsys
):
    fish = Fish(make_path("straight", length=2.0))

    def disarm():
        fish.disarmed, fish.asked = "camera lost", 0

    fish.events[3.0] = disarm
    Robot(nodes, fish, fish.listen, interruption).arm()
    Robot(nodes, fish, fish.listen, interruption).swim(600.0, Console())
    assert fish.disarmed == ""
    assert capsys.readouterr().out.count("disarmed (camera lost); armed again") == 1


def test_the_reason_of_a_foreign_node_is_shown_as_it_is_and_not_obeyed(nodes, interruption, capsys):
    fish = Fish(make_path("straight", length=2.0))

    def disarm():
        fish.disarmed, fish.asked = "[/x] \x1b[31m" + "m" * 5000, 0

    fish.events[3.0] = disarm
    Robot(nodes, fish, fish.listen, interruption).arm()
    Robot(nodes, fish, fish.listen, interruption).swim(600.0, Console())
    out = capsys.readouterr().out
    assert "disarmed ([/x] \\x1b[31mmm" in out
    assert "\x1b" not in out
    assert len(out) < 1000


def test_a_run_ends_at_the_end_of_an_open_path(nodes, interruption):
    fish = Fish(make_path("straight", length=2.0))
    assert swim(fish, nodes, interruption).reason == "at the end of the path"
    assert fish.time == pytest.approx(2.0 / 0.2 + 0.5, abs=0.3)


def test_a_run_on_a_closed_path_ends_after_a_lap(nodes, interruption):
    fish = Fish(make_path("circle", radius=0.5))
    assert swim(fish, nodes, interruption).reason == "after one lap"
    assert fish.time == pytest.approx(fish.path.length / 0.2, abs=0.3)


def test_a_run_ends_after_its_duration(nodes, interruption):
    fish = Fish(make_path("circle"))
    assert swim(fish, nodes, interruption, 3.0).reason == "after 3 s"
    assert fish.time == pytest.approx(3.0, abs=0.2)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_a_run_in_order(number, nodes, interruption):
    fish = Fish(make_path("circle"))
    fish.events[1.0] = lambda: os.kill(os.getpid(), number)
    assert swim(fish, nodes, interruption).reason == "as interrupted"
    assert fish.time < 1.5


def test_a_node_that_ends_is_said_with_its_last_words(nodes, interruption):
    fish = Fish(make_path("circle"))
    dead = SimpleNamespace(
        spec=NODE, status=3, last_words=lambda: "no such weights", log="node.log"
    )
    fish.events[1.0] = lambda: setattr(nodes, "ended", lambda: [dead])
    with pytest.raises(UserError, match="test/node ended with status 3: no such weights"):
        swim(fish, nodes, interruption)


class Stuck(Fish):
    """Nothing new is heard of it from the second second on; whoever listens waits."""

    @property
    def sight(self):
        self.time = min(self.time, 2.0)
        return super().sight

    def listen(self, seconds):
        time.sleep(0.01)
        super().listen(seconds)


def test_a_robot_of_which_nothing_new_is_heard_is_not_waited_for(nodes, interruption, monkeypatch):
    monkeypatch.setattr("fish_bringup.run_watch.STILL_TIMEOUT", 0.3)
    with pytest.raises(
        UserError, match=r"no new odometry/filtered for 0.3 s: .*hangs; see logs/fusion.log"
    ):
        swim(Stuck(make_path("circle")), nodes, interruption)


def test_a_slow_robot_is_waited_for(nodes, interruption, monkeypatch):
    """A stamp now and then is enough, its own time as slow as it will."""
    monkeypatch.setattr("fish_bringup.run_watch.STILL_TIMEOUT", 0.3)

    class Slow(Fish):
        def listen(self, seconds):
            time.sleep(0.1)
            super().listen(0.1 * seconds)

    fish = Slow(make_path("circle"))
    assert swim(fish, nodes, interruption, 0.1).reason == "after 0 s"


def test_an_experiment_ends_when_nothing_new_is_heard_of_the_robot(tmp_path, monkeypatch):
    """Its nodes are ended like those of any other run that fails."""
    monkeypatch.setattr("fish_bringup.run_watch.STILL_TIMEOUT", 0.3)
    fish, ended = Stuck(make_path("circle")), []
    fish.sees, fish.diagnostics = (
        lambda _: True,
        {excite.EXCITER_NAME: {"over": "false", "time_s": "2"}},
    )

    @contextmanager
    def started(domain, logs):
        try:
            yield SimpleNamespace(
                start=lambda *_: None,
                ended=lambda: [],
                running={FUSION: SimpleNamespace(log="fusion.log")},
            )
        finally:
            ended.append(domain)

    monkeypatch.setattr(excite, "NodeProcesses", started)
    monkeypatch.setattr(excite, "watching", lambda _: nullcontext((fish, fish.listen)))
    changed = {spec: {} for spec in excite.open_loop(ROBOTS["sim"])}
    with pytest.raises(UserError, match=r"no new odometry/filtered for 0.3 s: .*see fusion.log"):
        excite._swim(7, changed, SWIM, tmp_path, SimpleNamespace(asked=False), Console(quiet=True))
    assert ended == [7]


class Outside(Fish):
    """Its path leads through a wall, and nothing stops it."""

    def __init__(self):
        super().__init__(make_path("straight", length=6.0, x=1.5))


def test_a_fish_that_leaves_the_pool_ends_the_run(nodes, interruption):
    fish = Outside()
    with pytest.raises(
        UserError, match=r"the fish left the pool: .* now at \(2\.\d\d, 0\.00\) m; .* is kept"
    ):
        swim(fish, nodes, interruption)
    assert float(fish.path.point(0.2 * fish.time)[0]) < HALF_LENGTH + 0.4


class Blind(Fish):
    """Its camera sees nothing from the second second on; fusion goes on."""

    @property
    def seen(self):
        now, self.time = self.time, min(self.time, 2.0)
        seen = super().seen
        self.time = now
        return seen


def test_a_camera_that_is_silent_ends_the_run_although_fusion_goes_on(nodes, interruption):
    fish = Blind(make_path("circle", radius=0.9))
    fish.tracker = PathTracker(make_path("circle", radius=30.0))  # a lap that it never swims
    with pytest.raises(UserError, match=r"no camera/pose for 30 s: .* is kept"):
        swim(fish, nodes, interruption)
    assert fish.time == pytest.approx(2.0 + LONGEST_WITHOUT_CAMERA, abs=0.5)


def test_waiting_can_be_interrupted(nodes, interruption):
    fish = Fish(make_path("circle"))
    fish.events[1.0] = lambda: os.kill(os.getpid(), signal.SIGINT)
    with pytest.raises(KeyboardInterrupt):
        Robot(nodes, fish, fish.listen, interruption).wait_for(lambda: False, "nothing")


def test_handlers_are_put_back():
    before = signal.getsignal(signal.SIGTERM)
    with Interruption():
        assert signal.getsignal(signal.SIGTERM) != before
    assert signal.getsignal(signal.SIGTERM) == before
