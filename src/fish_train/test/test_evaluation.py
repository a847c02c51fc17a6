"""Metrics of known errors, plants and sensing, studies over cells, and the pages."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fish_control.contract import INPUTS, Contract
from fish_control.control_law import ControlLimits, Gains
from fish_control.gains_file import write_gains_file
from fish_control.paths import make_path
from fish_control.policy import Policy
from fish_sim.robot import Robot
from fish_sim.simulation import Simulation
from fish_sim.simulation_config import SimulationConfig
from fish_train.errors import UserError
from fish_train.evaluation import paper_numbers as paper
from fish_train.evaluation.candidates import constant_candidate, read_candidate
from fish_train.evaluation.cells import Cell, make_cells, read_path, start_pose
from fish_train.evaluation.conditions import make_condition, robust_conditions
from fish_train.evaluation.follow import Trace
from fish_train.evaluation.metrics import ErrorSizes, RunMetrics, measure
from fish_train.evaluation.open_loop import speed_of_throttle
from fish_train.evaluation.page import write_study_page
from fish_train.evaluation.paper_page import better_cells
from fish_train.evaluation.plant import FishSimPlant
from fish_train.evaluation.sensing import FusedSensing
from fish_train.evaluation.study import Row, detuned, evaluate, write_rows
from fish_train.evaluation.tables import cell_ratios, ratio_table, summary_table

GAINS = "0.3,0.3,0.03,0.6,0.05,0"
SHORT = "straight:length=0.8"


def straight_trace(offset: float, speed_error: float, wanted: float = 0.2) -> tuple[Trace, object]:
    """A robot that slides along a straight path, 10 s, `offset` to its left and too slow by `speed_error`."""
    path = make_path("straight", length=2.5)
    time = 0.02 * np.arange(1, 501)
    u = wanted - speed_error
    motion = np.zeros((500, 1, 6))
    motion[:, 0, 0], motion[:, 0, 1], motion[:, 0, 3] = u * time, offset, u
    cross_track = np.full((500, 1), offset)
    alpha, throttle = (0.1 * np.arange(500) * 0.02)[:, None], np.full((500, 1), 0.4)
    progress, course = (u * time)[:, None], np.zeros((500, 1))
    gains, speed, finished = np.full((500, 1, 6), 0.1), np.array([wanted]), np.array([True])
    return Trace(time, motion, cross_track, course, progress, alpha, throttle, gains, speed, finished), path


def test_metrics_of_known_errors() -> None:
    trace, path = straight_trace(0.02, 0.01)
    metrics = measure(trace, 0, path)
    assert metrics.failure == "" and metrics.approach == pytest.approx(0.02)
    for sizes in (metrics.settled, metrics.whole):
        assert sizes.cross_track_rmse == pytest.approx(0.02)
        assert sizes.cross_track_p95 == pytest.approx(0.02)
        assert sizes.speed_rmse == pytest.approx(0.01)
        assert sizes.heading_rmse == pytest.approx(0.0, abs=1e-12)
        assert sizes.rudder_rate_rms == pytest.approx(0.1)
        assert sizes.throttle_mean == pytest.approx(0.4)


def test_a_run_off_its_path_or_unfinished_has_failed() -> None:
    trace, path = straight_trace(0.2, 0.0)
    assert measure(trace, 0, path).failure == "never came onto the path"
    trace, path = straight_trace(0.01, 0.0)
    assert (
        measure(replace(trace, finished=np.array([False])), 0, path).failure
        == "did not reach the end in time"
    )
    far = trace.cross_track.copy()
    far[-100:] = 0.4
    assert "left the path" in measure(replace(trace, cross_track=far), 0, path).failure


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
        assert np.isnan([*vars(row.metrics.settled).values(), *vars(row.metrics.whole).values()]).all()
        assert np.isnan(row.metrics.approach)


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
        ["steady", "nominal, perfect state, still water", "2", "0"], ["steady", "nominal", "1", "0"]
    ]  # fmt: skip
    write_rows(tmp_path / "runs.csv", rows)
    assert len((tmp_path / "runs.csv").read_text().splitlines()) == 4
    write_study_page(tmp_path / "page.html", rows)
    assert "steady" in (tmp_path / "page.html").read_text()


def sizes(cross_track: float, speed: float) -> ErrorSizes:
    return ErrorSizes(cross_track, cross_track, cross_track, cross_track, 0.0, speed, speed, speed, 0.0, 0.0)


def rows_of(scale: float, condition: str) -> list[Row]:
    """The paper's own numbers times `scale`."""
    return [
        Row("a", condition, Cell(letter, v, 0), RunMetrics(*[sizes(scale * y, scale * u)] * 2, 1.0, ""))
        for letter in paper.LETTERS
        for v, y, u in zip(paper.SPEEDS, paper.CROSS_TRACK[letter], paper.SPEED[letter], strict=True)
    ]


def test_cells_better_than_the_papers() -> None:
    assert better_cells(rows_of(0.9, "c")) == 16
    assert better_cells(rows_of(1.1, "c")) == 0
    assert better_cells([*rows_of(0.9, "c")[:15], *rows_of(1.1, "c")[15:]]) == 15
    *good, last = rows_of(0.9, "c")
    failed = replace(last, metrics=replace(last.metrics, failure="did not reach the end in time"))
    assert better_cells([*good, failed]) == 15


def test_ratios_to_the_nominal_condition() -> None:
    rows = [*rows_of(1.0, "nominal"), *rows_of(1.5, "worse")]
    ratios = cell_ratios(rows, "a", "worse", "nominal")
    assert len(ratios) == 16
    assert list(ratios.values()) == [pytest.approx((1.5, 1.5))] * 16


def test_the_table_of_ratios_names_the_worst_cell_and_leaves_failed_runs_out() -> None:
    worse = rows_of(1.5, "worse")
    third = worse[2].metrics.settled
    worse[2] = replace(
        worse[2], metrics=replace(worse[2].metrics, settled=replace(third, speed_rmse=3.0 * third.speed_rmse))
    )
    worse[5] = replace(worse[5], metrics=replace(worse[5].metrics, failure="lost"))
    (line,) = ratio_table([*rows_of(1.0, "nominal"), *worse], "nominal", "t").rows
    cell = worse[2].cell
    assert line[2] == "1" and line[-1] == "1 of 15"
    assert line[4].endswith(f"4.50 ({cell.path} {cell.speed:g} m/s)")


def test_detuned_robots_keep_what_is_measured() -> None:
    robot = detuned(Robot(), 0.3, 4)
    ratio = {k: robot.parameters[k] / Robot().parameters[k] for k in robot.parameters}
    assert ratio["head_mass"] == ratio["link_length"] == 1.0
    others = [v for k, v in ratio.items() if k.endswith(("surge", "sway", "yaw", "stiffness"))]
    assert min(others) >= 0.7 and max(others) <= 1.3 and np.std(others) > 0.05
    assert detuned(Robot(), 0.3, 4) == robot


def test_full_throttle_is_faster_than_half() -> None:
    still, half, full = speed_of_throttle(Robot(), np.array([0.0, 0.5, 1.0]), ControlLimits())
    assert still == pytest.approx(0.0, abs=1e-6)
    assert 0.1 < half < full < 0.5


def test_starts_and_conditions() -> None:
    path = read_path(SHORT)
    assert start_pose(path, 0) == pytest.approx((-0.55, 0.0, 0.0), abs=1e-9)
    assert start_pose(path, 1) != start_pose(path, 2)
    names = [condition.name for condition in robust_conditions(Robot())]
    assert names == [
        "nominal", "nominal, parameters off by up to 30%", "nominal, camera latency 0.3 s", "nominal, current 0.03 m/s"
    ]  # fmt: skip


def test_a_condition_does_only_what_it_says() -> None:
    condition = make_condition(Robot(), off=0.2, current=0.05, perfect=True)
    assert condition.name == "nominal, perfect state, parameters off by up to 20%, current 0.05 m/s"
    assert condition.robot == Robot().with_effect("current", x=0.0, y=0.05)  # across the pool
    assert (condition.off, condition.fused, condition.disturbance) == (0.2, False, 0.0)
    late = make_condition(Robot(), latency=0.3)
    assert late.fused and late.sensors.camera_latency == 0.3 and late.disturbance > 0.0


def test_a_weights_file_the_node_refuses_is_refused_here(tmp_path: Path) -> None:
    others = (replace(INPUTS[0], name="depth"), *INPUTS[1:])
    for contract, said in (
        (Contract(layers=(), control_period=0.05), "control period is 0.05"),
        (Contract(layers=(), inputs=others), "inputs are .*depth"),
    ):
        write_gains_file(tmp_path / "w.safetensors", Policy.constant(Gains(*[0.05] * 6), contract))
        with pytest.raises(UserError, match=said):
            read_candidate(str(tmp_path / "w.safetensors"))


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
