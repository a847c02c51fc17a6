# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""A run that is watched: its limits, its excursions, its page."""

import os
import re
import signal
from contextlib import contextmanager, nullcontext
from functools import partial
from types import SimpleNamespace

import numpy as np
import plotly.graph_objects as go
import pytest
from rich.console import Console

from fish_bag.trial import Commands, Gains, Odometry, Trial
from fish_bringup import run_watch
from fish_bringup.node_table import ROBOTS, NodeSpec
from fish_bringup.run_page import write_run_page
from fish_bringup.run_watch import (
    EDGE,
    FUSION,
    LONGEST_AT_EDGE,
    LONGEST_WITHOUT_CAMERA,
    Robot,
    RunWatch,
    Seen,
    Sight,
)
from fish_bringup.score import error_table, score_motion
from fish_bringup.verbs import excite
from fish_control.excitation import Program, ProgramError, Row, command_table
from fish_control.excursions import COAST, MARGIN, SHORTEST, Excursion, excursions, next_begin
from fish_control.path_tracker import PathTracker
from fish_control.paths import make_path
from fish_control.pool import HALF_LENGTH, HALF_WIDTH, wall_distance
from fish_report.errors import Interruption, UserError
from fish_report.page import Figure, Table, Text, styled, write_page
from fish_sim.robot import Robot as FishModel
from fish_sim.way import way_from_rest
from fish_sysid.diagnosis.next_experiment import PLANS, RUDDER_STEPS, STRAIGHT_STEPS

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


@pytest.fixture
def real(monkeypatch):
    """Real time of a test, which passes when the test says so."""
    clock = SimpleNamespace(now=0.0)
    monkeypatch.setattr(run_watch, "time", SimpleNamespace(monotonic=lambda: clock.now))
    return clock


class Stuck(Fish):
    """Nothing new is heard of it from the second second on; whoever listens waits."""

    @property
    def sight(self):
        self.time = min(self.time, 2.0)
        return super().sight

    def __init__(self, path, real):
        super().__init__(path)
        self.real = real

    def listen(self, seconds):
        self.real.now += seconds
        super().listen(seconds)


def test_a_robot_of_which_nothing_new_is_heard_is_not_waited_for(nodes, interruption, real):
    with pytest.raises(
        UserError, match=r"no new odometry/filtered for 30 s: .*hangs; see logs/fusion.log"
    ):
        swim(Stuck(make_path("circle"), real), nodes, interruption)
    assert real.now == pytest.approx(32.0, abs=1.0)


def test_a_slow_robot_is_waited_for(nodes, interruption, real):
    """A stamp now and then is enough, its own time as slow as it will."""

    class Slow(Fish):
        def listen(self, seconds):
            real.now += 29.0
            super().listen(0.1 * seconds)

    fish = Slow(make_path("circle"))
    assert swim(fish, nodes, interruption, 0.1).reason == "after 0 s"
    assert real.now > 250.0


def test_an_experiment_ends_when_nothing_new_is_heard_of_the_robot(tmp_path, monkeypatch, real):
    """Its nodes are ended like those of any other run that fails."""
    fish, ended = Stuck(make_path("circle"), real), []
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
    with pytest.raises(UserError, match=r"no new odometry/filtered for 30 s: .*see fusion.log"):
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


FRAME = 1.0 / 30.0  # s


def reasons(watch, poses, begin=100.0):
    """What is said at each of the camera's poses (x, y)."""
    times = [begin + FRAME * k for k in range(len(poses))]
    return [watch.reason_to_end(t, Seen(t, x, y)) for t, (x, y) in zip(times, poses, strict=True)]


@pytest.mark.parametrize(
    "place",
    [
        (HALF_LENGTH, 0.0),
        (-HALF_LENGTH + 0.5 * EDGE, 0.3),
        (0.0, HALF_WIDTH),
        (0.0, -1.44),
        (0.5, 1.44),
    ],
)
def test_a_fish_at_a_wall_or_beyond_ends_the_run_after_a_second(place):
    said = reasons(RunWatch(100.0), [(0.0, 0.0)] * 10 + [place] * 60)
    first = next(k for k, reason in enumerate(said) if reason)
    assert (first - 10) * FRAME == pytest.approx(LONGEST_AT_EDGE, abs=1.5 * FRAME)
    assert said[first].startswith("the fish left the pool")
    assert f"({place[0]:.2f}, {place[1]:.2f}) m" in said[first]


def test_a_fish_that_comes_near_a_wall_or_is_misplaced_now_and_then_swims_on():
    near = (HALF_LENGTH - 2.0 * EDGE, 0.0)
    beyond = (HALF_LENGTH + 0.5, 0.0)
    assert reasons(RunWatch(100.0), [near] * 200 + ([beyond] * 20 + [near]) * 10) == [None] * 410


def test_a_pose_that_is_no_number_is_no_place_outside():
    nowhere = (float("nan"), 0.0)
    assert reasons(RunWatch(100.0), [(0.0, 0.0)] + [nowhere] * 200) == [None] * 201


def test_fusion_that_goes_on_without_the_camera_ends_the_run():
    watch = RunWatch(0.0)
    last = Seen(5.0, 0.0, 0.0)
    assert watch.reason_to_end(5.0 + LONGEST_WITHOUT_CAMERA, last) is None
    assert "no camera/pose for 30 s" in watch.reason_to_end(5.1 + LONGEST_WITHOUT_CAMERA, last)


def test_a_camera_that_never_spoke_is_waited_for_from_the_begin_on():
    watch = RunWatch(7.0)
    assert watch.reason_to_end(7.0 + LONGEST_WITHOUT_CAMERA, None) is None
    assert "no camera/pose" in watch.reason_to_end(7.1 + LONGEST_WITHOUT_CAMERA, None)


def test_a_pose_of_long_before_the_begin_counts_as_none():
    """An estimate that came late: the camera has its whole time from the begin on."""
    watch = RunWatch(100.0)
    assert watch.reason_to_end(110.0, Seen(60.0, 0.0, 0.0)) is None


def test_no_time_is_left_where_the_robots_clock_stands():
    """A slow computer asks often, and the robot's time does not pass."""
    watch = RunWatch(0.0, limit=10.0)
    assert {watch.reason_to_end(3.0, Seen(2.9, HALF_LENGTH, 0.0)) for _ in range(10_000)} == {None}


def test_the_limit_is_said():
    watch = RunWatch(50.0, limit=20.0)
    assert watch.reason_to_end(70.0, Seen(70.0, 0.0, 0.0)) is None
    assert watch.reason_to_end(70.1, Seen(70.0, 0.0, 0.0)) == "the run is not over after 20 s"


def test_a_pose_that_comes_out_of_order_is_left_out():
    watch = RunWatch(0.0)
    for stamp, x in ((1.0, HALF_LENGTH), (0.5, 0.0), (2.1, HALF_LENGTH)):
        said = watch.reason_to_end(stamp, Seen(stamp, x, 0.0))
    assert said is not None
    assert "left the pool" in said


WAY = partial(way_from_rest, FishModel())
EVERY_PLAN = list(
    {id(plan): plan for plan in (*PLANS.values(), STRAIGHT_STEPS, RUDDER_STEPS)}.values()
)


@pytest.mark.parametrize("plan", EVERY_PLAN, ids=lambda plan: plan[0].split(":")[0])
def test_every_experiment_that_a_diagnosis_proposes_can_be_swum_in_the_pool(plan):
    program = Program(tuple(Row(*map(float, row)) for row in plan[1]))
    swims = list(excursions(program, WAY))
    assert swims[0].begin == 0.0
    assert program.duration - swims[-1].end < SHORTEST
    assert [s.begin for s in swims[1:]] == [s.end for s in swims[:-1]]
    for swim in swims:
        way = WAY(command_table(program, swim.begin, swim.end, COAST))[:, :2]
        cos, sin = np.cos(swim.heading), np.sin(swim.heading)
        there = way @ np.array([[cos, sin], [-sin, cos]]) + [swim.x, swim.y]
        assert wall_distance(there) >= MARGIN - 1e-6
        assert np.ptp(there, axis=0).max() > 0.2  # it swims


def test_a_program_that_needs_more_room_than_there_is_is_refused():
    program = Program((Row(0.0, 12.0, 2.0, 0.0),))
    with pytest.raises(ProgramError, match=r"more room within 3 s than the pool has with 1.06 m"):
        list(excursions(program, WAY, margin=1.06))


def test_the_swims_of_a_plan_end_where_the_plan_says():
    rows = (Row(0.0, 5.0, 2.0, 0.4), Row(5.0, 5.0, 2.0, -0.4), Row(9.0, 8.0, 2.0, 0.4))
    swims = list(excursions(Program(rows, (5.0, 9.0, 15.0)), WAY))
    assert [(s.begin, s.end) for s in swims] == [(0.0, 5.0), (5.0, 9.0), (9.0, 15.0)]


@pytest.mark.parametrize(("reached", "begin"), [(3.0, 5.0), (2.0, 2.0), (5.0, 5.0), (13.0, 13.0)])
def test_what_is_too_short_for_a_swim_of_its_own_is_left_out(reached, begin):
    program = Program((Row(0.0, 5.0, 2.0, 0.4),), (5.0, 15.0))
    assert next_begin(program, reached) == begin


@pytest.fixture
def page(tmp_path):
    path = tmp_path / "report.html"
    figure = Figure("Curve", styled(go.Figure(go.Scatter(x=[0, 1], y=[2, 3]))))
    blocks = [
        Text("Words", "a <b> & c"),
        Table("Numbers", ["name", "m"], [["<x>", "1.5"]], "a note"),
        figure,
    ]
    write_page(path, "Title", "Lead.", blocks)
    return path.read_text()


def test_a_page_loads_nothing(page):
    outside = re.findall(r"<(?:script|link|img)[^>]+(?:src|href)\s*=\s*[\"']?([^\s\"'>]+)", page)
    assert outside == []


def test_text_is_escaped(page):
    assert "a &lt;b&gt; &amp; c" in page
    assert "<td>&lt;x&gt;</td>" in page


def test_blocks_stand_in_order_and_the_library_once(page):
    positions = [page.index(f"<h2>{title}</h2>") for title in ("Words", "Numbers", "Curve")]
    assert positions == sorted(positions)
    assert page.count("Plotly.newPlot(") == 1


def test_the_page_of_a_run_shows_path_errors_gains_and_commands(tmp_path):
    path = make_path("letter", letter="S")
    s = np.linspace(0.0, path.length, 500)
    t, zero = s / 0.2, np.zeros(500)
    stream = {
        "topic": "x",
        "frame_id": "pool",
        "t": t,
        "t_arrival": t,
        "flags": zero.astype(np.uint8),
    }
    x, y = path.point(s).T
    truth = Odometry(**stream, x=x, y=y, psi=path.heading_at(s), u=zero + 0.2, v=zero, r=zero)
    trial = Trial(
        name="run",
        path=tmp_path,
        origin_ns=0,
        duration=t[-1],
        namespace="/fish",
        axis="robot",
        truth=truth,
        commands=Commands(**stream, rotor_phase=zero, rotor_speed=zero, rudder=zero),
        gains=Gains(**stream, names=(), values=np.ones((500, 6))),
    )
    score = score_motion(truth, path, 0.2, 0.0, "truth")
    write_run_page(tmp_path / "report.html", "Run", trial, score, [error_table(score)])
    html = (tmp_path / "report.html").read_text()
    for title in (
        "Path in the pool",
        "Tracking errors",
        "Errors",
        "Surge speed",
        "Gains",
        "Commands",
    ):
        assert f"<h2>{title}</h2>" in html
