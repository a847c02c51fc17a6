# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Metrics of known errors, plants and sensing, measured feed-forward, studies over cells, and the pages."""

import re
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest

from fish_bag.trial import Odometry
from fish_bringup.score import score_motion
from fish_control.control_law import ControlLimits, Gains, feedforward_throttle
from fish_control.gains_file import write_gains_file
from fish_control.line_of_sight import GuidanceConfig, slip_lever
from fish_control.paths import make_path
from fish_control.policy import Policy
from fish_control.policy_spec import INPUTS, PolicySpec
from fish_report.errors import UserError
from fish_sim.robot import Robot
from fish_sim.simulation import Simulation
from fish_sim.simulation_config import SimulationConfig
from fish_train.evaluation import open_loop
from fish_train.evaluation.candidates import Candidate, constant_candidate, read_candidate
from fish_train.evaluation.cells import (
    RUN_UP,
    Cell,
    longest,
    make_cells,
    read_path,
    start_pose,
)
from fish_train.evaluation.follow import (
    NO_SIZES,
    ErrorSizes,
    RunMetrics,
    Trace,
    follow,
    measure,
)
from fish_train.evaluation.open_loop import (
    DoesNotSwim,
    SteadySwim,
    fitted_law,
    law_of_plant,
    law_of_robot,
    speed_of_throttle,
    steady_swims,
)
from fish_train.evaluation.plant import FishSimPlant, FusedSensing, PerfectSensing
from fish_train.evaluation.study import (
    LARGEST_BATCH,
    Row,
    detuned,
    evaluate,
    make_condition,
    robust_conditions,
    run_study,
    write_rows,
)
from fish_train.evaluation.tables import (
    cell_ratios,
    cell_table,
    ratio_table,
    summary_table,
    write_study_page,
)
from fish_train.training.closed_loop_equations import Law

GAINS = "0.3,0.3,0.03,0.6,0.05,0"
SHORT = "straight:length=0.8"


TIME = 0.02 * np.arange(1, 501)  # s
LIMITS = ControlLimits(
    curvature_gain=0.3,
    throttle_linear=0.7,
    throttle_quadratic=5.0,
    turn_linear=2.0,
    turn_quadratic=6.0,
)
GUIDANCE = GuidanceConfig(slip_arm=0.1, slip_time=0.3)
HEAVY = Robot().with_parameters(head_drag_surge=0.5)


def straight_trace(
    offset, speed_error=0.0, heading=0.0, wanted: float = 0.2
) -> tuple[Trace, object]:
    """A robot on a straight path for 10 s, `offset` to its left, too slow by `speed_error`, headed off by `heading`."""
    path = make_path("straight", length=2.5)
    offset, u, heading = (np.broadcast_to(v, 500) for v in (offset, wanted - speed_error, heading))
    progress, still = np.cumsum(0.02 * u), np.zeros(500)
    motion = np.column_stack([progress - 1.25, offset, heading, u, still, still])[:, None]
    alpha, throttle = (0.1 * TIME)[:, None], np.linspace(0.3, 0.5, 500)[:, None]
    course, gains = np.zeros((500, 1)), np.full((500, 1, 6), 0.1)
    trace = Trace(
        TIME,
        motion,
        offset[:, None],
        course,
        progress[:, None],
        alpha,
        throttle,
        gains,
        np.array([wanted]),
        np.array([True]),
        np.array([False]),
    )
    return trace, path


def test_metrics_of_known_errors() -> None:
    """Sines over whole periods: mean 2 A / pi, RMS A / sqrt 2, and 95 % of the time below A sin(0.95 pi / 2)."""
    wave = np.sin(np.pi * TIME)
    trace, path = straight_trace(0.02 * wave, 0.01 * np.roll(wave, 25), heading=-0.05)
    metrics = measure(trace, 0, path)
    assert metrics.failure == ""
    assert metrics.approach == pytest.approx(0.02)
    for sizes in (metrics.settled, metrics.whole):
        assert sizes.cross_track_mean == pytest.approx(0.02 * 2.0 / np.pi, rel=0.01)
        assert sizes.cross_track_rmse == pytest.approx(0.02 / np.sqrt(2.0), rel=0.01)
        assert sizes.cross_track_p95 == pytest.approx(0.02 * np.sin(0.95 * np.pi / 2.0), rel=0.01)
        assert sizes.cross_track_max == pytest.approx(0.02, rel=0.01)
        assert sizes.speed_mean == pytest.approx(0.01 * 2.0 / np.pi, rel=0.01)
        assert sizes.speed_rmse == pytest.approx(0.01 / np.sqrt(2.0), rel=0.01)
        assert sizes.speed_p95 == pytest.approx(0.01 * np.sin(0.95 * np.pi / 2.0), rel=0.01)
        assert sizes.heading_rmse == pytest.approx(0.05)
        assert sizes.rudder_rate_rms == pytest.approx(0.1)
        assert sizes.throttle_mean == pytest.approx(0.4, rel=1e-3)


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("late", ["path", "heading", "speed"])
def test_metrics_are_those_of_a_recorded_run(late: str, side: float) -> None:
    """What `robofish score` says of the same motion, with and without an approach that one error draws out."""
    fades = {
        name: np.maximum((4.0 if name == late else 1.0) - TIME, 0.0)
        for name in ("path", "heading", "speed")
    }
    stroke = np.sin(4.0 * np.pi * TIME)
    trace, path = straight_trace(
        side * (0.01 + 0.06 * fades["path"]),
        side * (0.005 + 0.03 * fades["speed"] + 0.06 * stroke),
        side * (0.2 * stroke - 0.25 * fades["heading"]),
    )
    x, y, psi, u, v, r = trace.motion[:, 0].T
    zeros = np.zeros(len(TIME), np.uint8)
    recorded = Odometry(
        topic="t",
        frame_id="pool",
        t=TIME,
        t_arrival=TIME,
        flags=zeros,
        x=x,
        y=y,
        psi=psi,
        u=u,
        v=v,
        r=r,
    )
    score, metrics = score_motion(recorded, path, 0.2, 0.0, "truth"), measure(trace, 0, path)
    assert metrics.approach == pytest.approx(score.approach_s)
    assert metrics.approach > 2.0
    for ours, with_approach in ((metrics.settled, False), (metrics.whole, True)):
        theirs = score.summaries(with_approach=with_approach)
        cross_track, speed = theirs["cross-track, m"], theirs["speed, m/s"]
        assert ours.cross_track_rmse == pytest.approx(cross_track.rmse, rel=1e-6)
        assert ours.cross_track_max == pytest.approx(cross_track.maximum, rel=1e-6)
        assert ours.heading_rmse == pytest.approx(theirs["heading, rad"].rmse, rel=1e-6)
        assert (ours.speed_rmse, ours.speed_p95) == pytest.approx((speed.rmse, speed.p95), rel=1e-6)


def test_a_run_off_its_path_or_unfinished_has_failed() -> None:
    trace, path = straight_trace(0.2)
    assert measure(trace, 0, path).failure == "never came onto the path"
    trace, path = straight_trace(0.01)
    unfinished = replace(trace, finished=np.array([False]))
    assert measure(unfinished, 0, path).failure == "did not reach the end in time"
    far = trace.cross_track.copy()
    far[-100:] = 0.4
    assert "left the path" in measure(replace(trace, cross_track=far), 0, path).failure


@pytest.mark.parametrize(("radius", "failure"), [(0.3, ""), (0.35, "did not go round in time")])
def test_a_run_that_stays_on_a_closed_path_without_going_round_has_failed(
    radius: float, failure: str
) -> None:
    """It swims 2 m of a circle, then stands on it: of a small one that is a lap, which has no end otherwise."""
    trace, _ = straight_trace(0.001)
    path = make_path("circle", radius=radius)
    assert measure(replace(trace, finished=np.array([False])), 0, path).failure == failure


class BurstingPlant(FishSimPlant):
    """A plant whose motion is no number from the second second on; the second robot's from the first step on."""

    steps = 0

    def step(self, commands: np.ndarray) -> None:
        self.steps += 1
        super().step(commands)

    @property
    def motion(self) -> np.ndarray:
        motion = super().motion
        motion[[self.steps >= 200, True]] = np.nan
        return motion


@pytest.mark.parametrize("path", [SHORT, "circle:radius=0.3"])
def test_a_run_that_diverges_has_failed_however_small_its_errors_were(path: str) -> None:
    condition = replace(make_condition(Robot(), perfect=True), plant=BurstingPlant)
    for row in evaluate(constant_candidate(GAINS), condition, make_cells([path], [0.25], [0, 1])):
        assert row.metrics.failure == "the motion diverged"
        assert np.isnan(
            [*vars(row.metrics.settled).values(), *vars(row.metrics.whole).values()]
        ).all()
        assert np.isnan(row.metrics.approach)


def drifting(path: str) -> Row:
    """One run in a current of 0.4 m/s towards y."""
    condition = make_condition(Robot().with_effect("current", x=0.0, y=0.4), perfect=True)
    return evaluate(constant_candidate(GAINS), condition, make_cells([path], [0.1], [0]))[0]


def test_a_robot_that_comes_to_a_wall_ends_its_run_and_has_failed() -> None:
    (row,) = [drifting("straight:length=0.8,y=0.9")]
    found = re.fullmatch(
        r"came to the pool's wall at \((.*), 1\.0[67]\) m after (.*) s", row.metrics.failure
    )
    assert found
    assert float(found[2]) < 3.0


def test_a_path_beyond_the_pool_is_swum_in_water_without_an_end() -> None:
    assert "wall" not in drifting("straight:length=0.8,y=3").metrics.failure


def test_plant_and_sensors_are_those_of_the_simulation() -> None:
    """The batch plant moves and measures like fish_sim.Simulation without noise from the water."""
    config = SimulationConfig(disturbance=0.0, start_x=0.1, seed=5)
    simulation, plant = Simulation(Robot(), config), FishSimPlant([Robot()], [5])
    plant.reset(np.array([[0.1, 0.0, 0.0]]))
    for k in range(100):
        command = 8.0 * np.sin(0.1257 * k), 0.2
        simulation.command(*command)
        truth = simulation.advance().truth
        plant.step(np.array([command]))
        assert plant.motion[0] == pytest.approx([*truth.pose, *truth.velocity], abs=1e-10)


def test_the_water_pushes_as_in_the_simulation() -> None:
    """Root mean squares over many fish that do nothing for 0.6 s; the random numbers are others."""
    plant, seeds = FishSimPlant([Robot()] * 32, range(32), disturbance=0.01), range(32)
    simulations = [
        Simulation(Robot(), SimulationConfig(disturbance=0.01, seed=seed)) for seed in seeds
    ]
    for _ in range(60):
        plant.step(np.zeros((32, 2)))
        truths = [simulation.advance().truth for simulation in simulations]
    theirs = np.array([(*truth.pose, *truth.velocity) for truth in truths])
    ratio = np.sqrt(np.mean(plant.motion**2, axis=0) / np.mean(theirs**2, axis=0))
    assert np.all((0.6 < ratio) & (ratio < 1.7))
    assert np.all(theirs.std(axis=0) > 1e-4)


def test_a_run_whose_time_is_over_has_not_finished_even_if_it_drifts_over_the_end_later() -> None:
    candidate, path = constant_candidate(GAINS), read_path(SHORT)
    trace = follow(
        FishSimPlant([Robot()] * 2, [0, 0]),
        PerfectSensing(),
        candidate.gains,
        [path] * 2,
        np.array([0.25, 0.25]),
        np.array([start_pose(path, 0)] * 2),
        np.array([2.0, 30.0]),
        law_at_once(candidate),
    )
    assert trace.finished.tolist() == [False, True]
    ends = [trace.time[np.isfinite(trace.cross_track[:, k])].max() for k in range(2)]
    assert ends[0] == pytest.approx(2.0)
    assert ends[1] == trace.time[-1] < 12.0
    assert trace.progress[-1, 1] == pytest.approx(path.length)


def law_at_once(candidate: Candidate) -> Law:
    """The candidate's law for a fish that does not listen before it swims."""
    return replace(candidate.law, guidance=replace(candidate.law.guidance, listen_time=0.0))


def test_fused_sensing_finds_the_truth() -> None:
    plant, sensing = FishSimPlant([Robot()] * 2, [1, 2]), FusedSensing([Robot()] * 2, [1, 2])
    plant.reset(np.array([[0.0, 0.0, 0.3], [0.5, 0.2, -1.0]]))
    errors = []
    for k in range(1, 401):
        plant.step(np.tile([100.0 * np.sin(0.1257 * k), 0.1], (2, 1)))
        seen, known = sensing.update(0.01 * k, plant.motion)
        if k > 200:
            assert known.all()
            errors.append(seen - plant.motion)
    rms = np.sqrt(np.mean(np.square(errors), axis=(0, 1)))
    assert np.all(rms < [0.01, 0.01, 0.03, 0.03, 0.05, 0.05])


def test_a_study_of_short_swims(tmp_path: Path) -> None:
    candidate = constant_candidate(f"steady={GAINS}")
    cells = make_cells([SHORT], [0.25], [0, 1])
    perfect = evaluate(candidate, make_condition(Robot(), perfect=True), cells)
    fused = evaluate(candidate, make_condition(Robot()), cells[:1])
    rows = [*perfect, *fused]
    assert [row.metrics.failure for row in rows] == ["", "", ""]
    assert max(row.metrics.settled.cross_track_rmse for row in rows) < 0.03
    table = summary_table(rows, "t")
    assert [line[:4] for line in table.rows] == [
        ["steady", "nominal, perfect state, still water", "2", "0"],
        ["steady", "nominal", "1", "0"],
    ]
    write_rows(tmp_path / "runs.csv", rows)
    assert len((tmp_path / "runs.csv").read_text().splitlines()) == 4
    write_study_page(tmp_path / "page.html", rows)
    page = (tmp_path / "page.html").read_text()
    assert "steady" in page
    assert "a closed one for the time of 2 laps" in page


def sizes(cross_track: float, speed: float) -> ErrorSizes:
    return ErrorSizes(
        cross_track, cross_track, cross_track, cross_track, 0.0, speed, speed, speed, 0.0, 0.0
    )


def rows_of(scale: float, condition: str) -> list[Row]:
    """Sixteen cells, each with errors of its own times `scale`; the third has a speed error of 0.03 m/s."""
    cells = [Cell(letter, speed, 0) for letter in "IROS" for speed in (0.10, 0.15, 0.20, 0.25)]
    return [
        Row(
            "a",
            condition,
            cell,
            RunMetrics(*[sizes(scale * 0.01 * (k + 1), scale * 0.03)] * 2, 1.0, ""),
        )
        for k, cell in enumerate(cells)
    ]


def test_ratios_to_the_nominal_condition() -> None:
    rows = [*rows_of(1.0, "nominal"), *rows_of(1.5, "worse")]
    ratios = cell_ratios(rows, "a", "worse", "nominal")
    assert len(ratios) == 16
    assert list(ratios.values()) == [pytest.approx((1.5, 1.5))] * 16


def test_the_table_of_ratios_names_the_worst_cell_and_counts_one_that_failed_as_above_twice() -> (
    None
):
    worse = rows_of(1.5, "worse")
    third = worse[2].metrics.settled
    worse[2] = replace(
        worse[2],
        metrics=replace(
            worse[2].metrics, settled=replace(third, speed_rmse=3.0 * third.speed_rmse)
        ),
    )
    worse[5] = replace(worse[5], metrics=replace(worse[5].metrics, failure="lost"))
    table = ratio_table([*rows_of(1.0, "nominal"), *worse], "nominal", "t")
    (line,), cell = table.rows, worse[2].cell
    assert line[2] == "1"
    assert line[-1] == "2 of 16"
    assert "counts as above twice" in table.note
    assert line[4].endswith(f"4.50 ({cell.path} {cell.speed:g} m/s)")


def test_a_cell_that_fails_under_the_nominal_condition_too_or_in_part_is_not_counted_as_lost() -> (
    None
):
    def failed(row: Row) -> Row:
        return replace(row, metrics=replace(row.metrics, failure="lost"))

    nominal, worse = rows_of(1.0, "nominal"), rows_of(1.5, "worse")
    again = replace(worse[6], cell=replace(worse[6].cell, seed=1))
    nominal[5], worse[5], worse[6] = failed(nominal[5]), failed(worse[5]), failed(worse[6])
    (line,) = ratio_table([*nominal, *worse, again], "nominal", "t").rows
    assert line[-1] == "0 of 15"


def test_tables_are_means_over_the_runs_that_did_not_fail_in_millimetres() -> None:
    def run(cross_track: float, speed: float, seed: int, failure: str = "") -> Row:
        settled, whole = sizes(cross_track, speed), sizes(2.0 * cross_track, 2.0 * speed)
        return Row("a", "c", Cell("R", 0.2, seed), RunMetrics(settled, whole, 1.0, failure))

    rows = [run(0.010, 0.020, 0), run(0.014, 0.030, 1), run(9.0, 9.0, 2, "lost")]
    table = summary_table(rows, "t")
    (line,) = table.rows
    shown = dict(zip(table.header, line, strict=True))
    assert (shown["runs"], shown["failed"]) == ("3", "1")
    assert (shown["cross-track RMSE, mm"], shown["speed RMSE, mm/s"]) == ("12", "25")
    assert (shown["cross-track RMSE *, mm"], shown["speed RMSE *, mm/s"]) == ("24", "50")
    assert cell_table(rows, "t").rows == [["R", "12.0 / 25.0 (1 of 3 failed)"]]
    assert cell_table(rows[:2], "t").rows == [["R", "12.0 / 25.0"]]
    assert cell_table(rows[2:], "t").rows == [["R", "failed"]]


def test_a_study_swims_every_cell_once_for_each_candidate_and_condition(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    batches, told = [], []

    def evaluate(candidate, condition, cells) -> list[Row]:
        batches.append(len(cells))
        return [
            Row(candidate.name, condition.name, c, RunMetrics(NO_SIZES, NO_SIZES, 0.0, ""))
            for c in cells
        ]

    monkeypatch.setattr("fish_train.evaluation.study.evaluate", evaluate)
    candidates = [constant_candidate(f"{name}={GAINS}") for name in "ab"]
    conditions = [make_condition(Robot()), make_condition(Robot(), latency=0.3)]
    cells = make_cells([SHORT, "circle"], [0.1, 0.2], range(5))
    rows = run_study(
        candidates, conditions, cells, 1, lambda done, total: told.append((done, total))
    )
    expected = {(c.name, d.name, cell) for c in candidates for d in conditions for cell in cells}
    assert len(rows) == len(expected)
    assert {(r.candidate, r.condition, r.cell) for r in rows} == expected
    assert max(batches) <= LARGEST_BATCH
    assert told == [(k + 1, len(batches)) for k in range(len(batches))]


def test_detuned_robots_keep_what_is_measured() -> None:
    robot = detuned(Robot(), 0.3, 4)
    ratio = {k: robot.parameters[k] / Robot().parameters[k] for k in robot.parameters}
    assert ratio["head_mass"] == ratio["link_length"] == 1.0
    others = [v for k, v in ratio.items() if k.endswith(("surge", "sway", "yaw", "stiffness"))]
    assert min(others) >= 0.7
    assert max(others) <= 1.3
    assert np.std(others) > 0.05
    assert detuned(Robot(), 0.3, 4) == robot


def test_speeds_at_throttles_are_those_of_the_feedforward() -> None:
    throttles = np.array([0.0, 0.2, 0.6])
    speeds = speed_of_throttle(Robot(), throttles, ControlLimits())
    np.testing.assert_allclose(
        feedforward_throttle(speeds, 0.0, ControlLimits()), throttles, atol=0.02
    )


def test_starts_are_scattered_to_the_sides_and_in_heading_but_not_along_the_path() -> None:
    course = 2.0
    path = make_path("straight", length=0.8, course=course)
    begin, heading = path.point(0.0), np.array([np.cos(course), np.sin(course)])
    assert start_pose(path, 0) == pytest.approx((*(begin - RUN_UP * heading), course))
    starts = np.array([start_pose(path, seed) for seed in range(1, 200)])
    along = (starts[:, :2] - begin) @ heading
    left = (starts[:, :2] - begin) @ [-heading[1], heading[0]]
    np.testing.assert_allclose(along, -RUN_UP)
    assert (left.mean(), left.std()) == pytest.approx((0.0, 0.01), abs=0.002)
    assert (starts[:, 2].mean(), starts[:, 2].std()) == pytest.approx((course, 0.05), abs=0.01)
    assert start_pose(path, 1) == start_pose(path, 1) != start_pose(path, 2)


def test_a_run_has_time_for_its_path() -> None:
    """Two laps of a closed path, half as much again for an open one, and time to start."""
    circle, straight = make_path("circle", radius=0.5), make_path("straight", length=0.8)
    assert longest(circle, 0.2) == pytest.approx(
        (2.0 * 2.0 * np.pi * 0.5 + 0.15) / 0.2 + 4.0, rel=1e-4
    )
    assert longest(straight, 0.1) == pytest.approx(1.5 * (0.8 + 0.15) / 0.1 + 8.0)


def test_starts_and_conditions() -> None:
    path = read_path(SHORT)
    assert start_pose(path, 0) == pytest.approx((-0.55, 0.0, 0.0), abs=1e-9)
    names = [condition.name for condition in robust_conditions(Robot())]
    assert names == [
        "nominal",
        "nominal, parameters off by up to 30%",
        "nominal, camera latency 0.3 s",
        "nominal, current 0.03 m/s",
    ]


def test_a_condition_does_only_what_it_says() -> None:
    condition = make_condition(Robot(), off=0.2, current=0.05, perfect=True)
    assert condition.name == "nominal, perfect state, parameters off by up to 20%, current 0.05 m/s"
    assert condition.robot == Robot().with_effect("current", x=0.0, y=0.05)  # across the pool
    assert (condition.off, condition.fused, condition.disturbance) == (0.2, False, 0.0)
    late = make_condition(Robot(), latency=0.3)
    assert late.fused
    assert late.sensors.camera_latency == 0.3
    assert late.disturbance > 0.0


def test_a_weights_file_the_node_refuses_is_refused_here(tmp_path: Path) -> None:
    others = (replace(INPUTS[0], name="depth"), *INPUTS[1:])
    for contract, said in (
        (PolicySpec(layers=(), control_period=0.05), "control period is 0.05"),
        (PolicySpec(layers=(), inputs=others), "inputs are .*depth"),
    ):
        write_gains_file(tmp_path / "w.safetensors", Policy.constant(Gains(*[0.05] * 6), contract))
        with pytest.raises(UserError, match=said):
            read_candidate(str(tmp_path / "w.safetensors"))


def test_a_weights_file_may_lie_in_a_folder_named_after_its_recipe(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    file = Path("lr=1e-4/gains.safetensors")
    file.parent.mkdir()
    write_gains_file(file, Policy.constant(Gains(*[0.05] * 6)))
    assert read_candidate(str(file)).name == "lr=1e-4/gains"
    assert read_candidate(f"slow={file}").name == "slow"


@pytest.mark.parametrize("off", [1.0, -0.3, float("nan")])
def test_parameters_are_off_by_a_share(off: float) -> None:
    with pytest.raises(ValueError, match=f"off: got {off:g}; expected a share"):
        make_condition(Robot(), off=off)


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: read_path("circle:radius"), "expected NAME=VALUE"),
        (lambda: read_path("circle:radius=[1"), r"got '\[1' as radius; expected a number"),
        (lambda: read_path("circle:radius=2020-13-45"), "got '2020-13-45' as radius"),
        (lambda: read_path("circel"), "unknown path 'circel'"),
        (lambda: read_path("circle:radius=-1"), "radius"),
        (lambda: make_cells(["R"], [0.9], [0]), "speed: got 0.9 m/s"),
        (lambda: constant_candidate("1,2,3"), "got 3 numbers; expected 6"),
        (lambda: constant_candidate("0.3,0.3,9,0.6,0.05,0"), "steering_kd: got 9"),
        (lambda: read_candidate("nowhere.safetensors"), "nowhere.safetensors"),
    ],
)
def test_bad_input_is_said(call, said: str) -> None:
    with pytest.raises(UserError, match=said):
        call()


def constants(law: Law) -> dict[str, float]:
    return {**asdict(law.limits), **asdict(law.guidance)}


def swims(limits: ControlLimits, guidance: GuidanceConfig) -> SteadySwim:
    """Of a fish that obeys the law's equations."""
    u, alpha = (a.ravel() for a in np.meshgrid([0.08, 0.15, 0.25], [0.0, 0.2, -0.2, 0.4, -0.4]))
    kappa = alpha / limits.curvature_gain
    slip = -slip_lever(u, guidance) * u * kappa
    return SteadySwim(feedforward_throttle(u, alpha, limits), alpha, u, slip, u * kappa)


def test_a_fish_that_obeys_the_equations_gives_their_constants() -> None:
    found = fitted_law(swims(LIMITS, GUIDANCE), Law())
    assert constants(found) == pytest.approx(constants(Law(limits=LIMITS, guidance=GUIDANCE)))


def test_what_is_not_measured_stays() -> None:
    law = Law(limits=ControlLimits(derivative_time=0.4), guidance=GuidanceConfig(listen_time=1.0))
    found = fitted_law(swims(LIMITS, GUIDANCE), law)
    assert (found.limits.derivative_time, found.guidance.listen_time) == (0.4, 1.0)


def test_the_nominal_fish_has_the_laws_own_constants() -> None:
    """The defaults were fitted by hand on other swims: the throttle to 0.05, the others to a tenth."""
    found, law = law_of_robot(Robot()), Law()
    for u in (0.1, 0.2, 0.3):
        for alpha in (0.0, 0.3):
            own, given = (feedforward_throttle(u, alpha, each.limits) for each in (found, law))
            assert own == pytest.approx(given, abs=0.05)
        assert slip_lever(u, found.guidance) == pytest.approx(slip_lever(u, law.guidance), rel=0.1)
    assert found.limits.curvature_gain == pytest.approx(law.limits.curvature_gain, rel=0.1)


def test_a_robot_swims_at_the_speed_that_its_own_feed_forward_says() -> None:
    """Throttles and rudders that were not among those measured."""
    law = law_of_robot(HEAVY)
    wanted = [(0.12, 0.0), (0.2, 0.0), (0.15, 0.25)]
    rows = [(float(feedforward_throttle(u, alpha, law.limits)), alpha) for u, alpha in wanted]
    swum = steady_swims(FishSimPlant([HEAVY] * 6, range(6)), rows, law.limits)
    assert swum.surge == pytest.approx([u for u, _ in wanted], abs=0.01)
    nominal = [float(feedforward_throttle(u, alpha, Law().limits)) for u, alpha in wanted]
    assert all(own > 1.3 * other for (own, _), other in zip(rows, nominal, strict=True))
    assert swum.yaw_rate[2] / swum.surge[2] == pytest.approx(
        0.25 / law.limits.curvature_gain, rel=0.15
    )


def test_the_water_of_the_pool_is_no_part_of_the_robot() -> None:
    there = HEAVY.with_effect("current", x=0.03, y=-0.02).with_effect(
        "wall_effect", k=2.5, length=0.2
    )
    assert constants(law_of_robot(there)) == constants(law_of_robot(HEAVY))
    # a plant whose water flows cannot be asked to stop it: two opposite headings tell the current from the fish
    flowing = HEAVY.with_effect("current", x=0.03, y=-0.02)
    found = law_of_plant(lambda count: FishSimPlant([flowing] * count, range(count)))
    for u in (0.1, 0.2):
        assert feedforward_throttle(u, 0.0, found.limits) == pytest.approx(
            feedforward_throttle(u, 0.0, law_of_robot(HEAVY).limits), rel=0.05
        )


def test_what_does_not_swim_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    good = swims(LIMITS, GUIDANCE)
    with pytest.raises(DoesNotSwim, match="expected all above 0"):
        fitted_law(replace(good, surge=-good.surge), Law())
    with pytest.raises(DoesNotSwim, match="expected all above 0"):
        fitted_law(replace(good, surge=np.full_like(good.surge, np.nan)), Law())
    with pytest.raises(DoesNotSwim, match="a rudder to the left turns to the right"):
        fitted_law(replace(good, yaw_rate=-good.yaw_rate), Law())
    monkeypatch.setattr(open_loop, "SETTLING", 1.0)
    with pytest.raises(DoesNotSwim):
        law_of_robot(Robot().with_parameters(head_drag_surge=1000.0))
