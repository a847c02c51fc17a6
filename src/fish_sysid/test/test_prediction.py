# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Predictions, their baselines and their noise."""

from __future__ import annotations

import csv
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fish_report.errors import UserError
from fish_sim.robot import Robot, RobotError
from fish_sim.robot_file import load_robot, save_robot
from fish_sim.step import Stepper
from fish_sysid.dataset.camera import forward
from fish_sysid.dataset.experiment import Experiment, Frames
from fish_sysid.dataset.synthetic import program, record
from fish_sysid.estimation.ekf import run_filter
from fish_sysid.estimation.ekf_types import FilterResult, Noise
from fish_sysid.prediction import prediction
from fish_sysid.prediction.baselines import (
    STEP,
    Table,
    _travel,
    constant,
    fit_arx,
    fit_baselines,
    fit_bilinear,
    inputs,
    predict_baseline,
)
from fish_sysid.prediction.kept_noise import kept_noise, uses_shooting, with_noise
from fish_sysid.prediction.prediction import predict, prediction_errors
from fish_sysid.prediction.stroke_average import HALF_WINDOW, stroke_mean
from fish_sysid.reports.identify_tables import COLUMNS, write_predictions

QUIET = Noise(
    wrench=(1e-6, 1e-6, 1e-8),
    gyro=1e-4,
    accel=1e-3,
    camera_position=1e-5,
    camera_heading=1e-5,
    encoder=1e-3,
)
ROBOT = Robot()


@pytest.fixture(scope="module")
def quiet() -> Experiment:
    random = np.random.default_rng(5)
    commands = np.stack(
        [program(kind, 8.0, random) for kind in ("sines", "steps", "random")], axis=1
    )
    experiment = record(ROBOT, commands, QUIET, random)[0]
    return replace(experiment, gyro=experiment.gyro, steps=np.array([800, 800, 500]))


def test_true_model_without_noise_predicts_exactly(quiet: Experiment) -> None:
    errors = prediction_errors(predict(quiet, ROBOT, QUIET, 2.0, 1.0, 1.0), (1.0, 2.0))
    assert np.all(errors.rms[:, 0] < 1e-3)
    assert np.all(errors.rms[:, 1] < 5e-3)
    assert errors.counts[2, 1] < errors.counts[0, 1]  # the third trial is shorter


@pytest.mark.parametrize("ahead", [0.0, 0.5])
def test_later_measurements_change_nothing_before_them(quiet: Experiment, ahead: float) -> None:
    cut = 4.0
    frames = tuple(
        Frames(f.t, f.pose + np.where(f.t > cut, 1.0, 0.0)[:, None]) for f in quiet.frames
    )
    gyro = quiet.gyro.copy()
    gyro[int(cut / 0.01) + 1 :] += 1.0
    a = predict(quiet, ROBOT, Noise(), 1.0, ahead=ahead)
    b = predict(replace(quiet, frames=frames, gyro=gyro), ROBOT, Noise(), 1.0, ahead=ahead)
    early = a.start * 0.01 <= cut - ahead - 0.01
    np.testing.assert_array_equal(a.pose[:, early], b.pose[:, early])
    assert not np.allclose(a.pose[0, ~early], b.pose[0, ~early], equal_nan=True)


def test_starts_every_horizon_and_end_with_the_trial(quiet: Experiment) -> None:
    found = predict(quiet, ROBOT, Noise(), 2.0)
    assert (found.start[found.trial == 0] * 0.01).tolist() == [0.0, 2.0, 4.0, 6.0]
    last = found.pose[:, np.flatnonzero(found.trial == 2)[-1], 0]
    assert np.isfinite(last).sum() == 100  # 4.00 .. 4.99 s


def test_a_filter_that_diverges_begins_anew(
    quiet: Experiment, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = prediction.estimate(quiet, ROBOT, Noise())

    def diverging(experiment: Experiment, *args: object, **keywords: object) -> FilterResult:
        result = run_filter(experiment, *args, **keywords)
        if experiment.start_at_rest:  # the first time, not when it begins anew
            result.history.filtered[200:, 1] = np.nan
        return result

    monkeypatch.setattr(prediction, "run_filter", diverging)
    broken = prediction.estimate(quiet, ROBOT, Noise())
    np.testing.assert_array_equal(broken.pose[:, [0, 2]], whole.pose[:, [0, 2]])
    np.testing.assert_allclose(broken.pose[400:800, 1], whole.pose[400:800, 1], atol=0.03)
    np.testing.assert_allclose(
        broken.velocity[400:800, 1, 0], whole.velocity[400:800, 1, 0], atol=0.03
    )


CAMERA_ERRORS = {
    "camera_heading_offset": ("offset", 0.1, lambda f: Frames(f.t, f.pose + [0.0, 0.0, 0.1])),
    "camera_scale": ("factor", 1.05, lambda f: Frames(f.t, f.pose * [1.05, 1.05, 1.0])),
    "camera_marker": ("ahead", -0.03, lambda f: Frames(f.t, forward(f.pose, -0.03))),
    "camera_latency": ("delay", 0.2, lambda f: Frames(f.t + 0.2, f.pose)),
}


@pytest.mark.parametrize("name", CAMERA_ERRORS)
def test_camera_errors_of_the_model_are_in_what_it_predicts(
    quiet: Experiment, tmp_path, name: str
) -> None:
    key, value, wrong = CAMERA_ERRORS[name]
    robot = ROBOT.with_effect(name, **{key: value})
    seen = replace(quiet, frames=tuple(map(wrong, quiet.frames)))
    predictions = predict(seen, robot, QUIET, 1.0, 1.0, 1.0)
    assert np.all(prediction_errors(predictions, (1.0,)).rms[0] < [1e-3, 5e-3, 5e-3])
    write_predictions(tmp_path / "table.csv", predictions)
    with (tmp_path / "table.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    for row in rows:
        assert abs(float(row["predicted_x"]) - float(row["measured_x"])) < 3e-3
        assert float(row["start"]) - 1e-9 <= float(row["time"]) - (
            0.2 if name == "camera_latency" else 0.0
        )


def test_a_baseline_predicts_what_the_camera_shows(quiet: Experiment) -> None:
    """Where the camera is wrong and the model knows it, the baselines' errors are those of a camera that is right."""
    found = []
    for robot, frames in (
        (ROBOT, quiet.frames),
        (
            ROBOT.with_effect("camera_marker", ahead=-0.03).with_effect(
                "camera_heading_offset", offset=0.1
            ),
            tuple(
                Frames(f.t, forward(f.pose, -0.03) + np.array([0.0, 0.0, 0.1]))
                for f in quiet.frames
            ),
        ),
    ):
        seen = replace(quiet, frames=frames)
        made = predict_baseline(constant(), predict(seen, robot, QUIET, 1.0, 1.0, 1.0))
        found.append(prediction_errors(made, (1.0,)).rms[0, 1])
    assert found[1] == pytest.approx(found[0], rel=1e-3)


def test_an_unexplained_force_dies_away_with_the_waters_time(quiet: Experiment) -> None:
    """Against a force that is told to the simulator anew at every step."""
    noise, push, start = replace(Noise(), wrench_time=0.3), np.array([0.05, -0.04, 1e-3]), 100
    state = prediction.estimate(quiet, ROBOT, QUIET).state[start, :1]
    found = prediction._simulate(
        quiet, ROBOT, noise, np.array([[0, start]]), state, push[None], 120
    )
    robot = ROBOT.with_effect("disturbance")
    stepper = Stepper.of(robot)
    for k in range(120):
        now = push * np.exp(-(k + 0.5) * 0.01 / 0.3)
        p = stepper.parameters(
            robot.with_effect("disturbance", surge=now[0], sway=now[1], yaw=now[2])
        )
        state = stepper.step(state, quiet.commands[start + k, :1], p[None])
    np.testing.assert_allclose(found[120, 0], state[0, :3], atol=3e-4)
    free = prediction._simulate(
        quiet, ROBOT, noise, np.array([[0, start]]), state, np.zeros((1, 3)), 120
    )
    assert np.abs(found[120] - free[120]).max() > 0.01


def test_a_filter_lost_for_good_predicts_nothing_from_there_on(quiet: Experiment) -> None:
    """No image comes after it with which it could begin anew."""
    commands, frames = quiet.commands.copy(), list(quiet.frames)
    commands[400:430, 1, 0] = 1e9  # rad/s
    seen = frames[1].t < 4.0
    frames[1] = Frames(frames[1].t[seen], frames[1].pose[seen])
    lost = replace(quiet, commands=commands, frames=tuple(frames))
    found = predict(lost, Robot(), Noise(), 1.0, every=0.5, first=1.0)
    counts = prediction_errors(found, (1.0,)).counts[:, 0]
    assert counts[0] > counts[1] > 0


def test_velocities_of_the_body_are_those_of_the_pool_turned() -> None:
    """Heading north-west and moving west: ahead and to the left alike."""
    state = np.zeros((1, 14))
    state[0, 2], state[0, 6:9] = 0.75 * np.pi, (-0.2, 0.0, 0.7)
    u, v, r = prediction.body_velocity(state, 3)[0]
    assert (u, v, r) == pytest.approx((0.2 / np.sqrt(2.0), 0.2 / np.sqrt(2.0), 0.7))


def test_a_heading_a_whole_turn_off_is_no_error() -> None:
    t = np.arange(0.0, 2.0, 1 / 30)
    pose = np.column_stack([0.1 * t, 0.0 * t, 0.0 * t])
    squares, count = prediction._squares(
        t, pose, (pose + [0.03, 0.04, 2.0 * np.pi + 0.1])[:, None], np.array([1.0])
    )
    assert count == 1
    np.testing.assert_allclose(squares[:2], [0.05**2, 0.1**2])


def test_bad_horizon_is_refused(quiet: Experiment) -> None:
    for horizon in (0.0, -1.0, np.nan, 1e9):
        with pytest.raises(ValueError, match="horizon"):
            predict(quiet, ROBOT, Noise(), horizon)


def test_horizon_longer_than_every_trial_has_no_error(quiet: Experiment) -> None:
    errors = prediction_errors(predict(quiet, ROBOT, Noise(), 20.0, 20.0), (20.0,))
    assert errors.counts.sum() == 0
    assert errors.as_table() == {}


def test_table(quiet: Experiment, tmp_path) -> None:
    path = tmp_path / "new" / "predictions.csv"
    count = write_predictions(path, predict(quiet, ROBOT, Noise(), 2.0))
    with path.open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert tuple(rows[0]) == COLUMNS
    assert len(rows) == count
    inside = [
        f.t[f.t < 0.01 * (steps - 1)] for f, steps in zip(quiet.frames, quiet.steps, strict=True)
    ]
    assert count == sum(map(len, inside))
    middle = [r for r in rows if r["trial"] == "synthetic_00" and 2.5 < float(r["time"]) < 3.5]
    for row in middle:
        assert abs(float(row["predicted_x"]) - float(row["measured_x"])) < 0.02
        assert abs(float(row["predicted_u"]) - float(row["measured_u"])) < 0.02


def test_stroke_mean_of_a_circle_and_of_a_swing() -> None:
    t = np.arange(0.0, 4.0, 1 / 30)
    speed, rate = 0.2, 0.5
    circle = np.column_stack(
        [speed / rate * np.sin(rate * t), speed / rate * (1 - np.cos(rate * t)), rate * t]
    )
    circle[:, 2] += 0.2 * np.sin(4 * np.pi * t)  # the swing of the strokes at 2 Hz
    centres = np.array([1.0, 2.0, 3.0])
    mean = stroke_mean(t, centres)(circle)
    np.testing.assert_allclose(mean[:, 2], rate * centres, atol=2e-3)
    np.testing.assert_allclose(mean[:, 3], speed, rtol=0.01)
    assert np.all(np.abs(mean[:, 5] - rate) < 0.07 * 0.2 * 4 * np.pi)
    assert np.isnan(stroke_mean(t, np.array([0.1]))(circle)).all()


def circling(speed: float, rate: float, duration: float = 8.0) -> Experiment:
    """One trial that turns steadily without strokes."""
    steps, t = round(duration / 0.01), np.arange(0.0, duration - 0.01, 1 / 30)
    pose = np.column_stack(
        [speed / rate * np.sin(rate * t), speed / rate * (1 - np.cos(rate * t)), rate * t]
    )
    commands = np.zeros((steps, 1, 2))
    nothing = np.full((steps, 1), np.nan)
    accel = np.full((steps, 1, 2), np.nan)
    return Experiment(
        ("circle",), np.array([steps]), commands, nothing, accel, nothing, (Frames(t, pose),), False
    )


@pytest.mark.parametrize("lead", [0.0, HALF_WINDOW])
def test_constant_baseline_follows_a_circle(lead: float) -> None:
    experiment = circling(0.2, 0.5)
    like = predict(
        experiment, ROBOT, replace(Noise(), wrench=(1.0, 1.0, 0.1), gate_camera=1e9), 2.0, 1.0, 2.0
    )
    errors = prediction_errors(predict_baseline(constant(), like, lead), (1.0, 2.0))
    assert np.all(errors.rms[:, 0] < 2e-3)  # the chord of a second's window
    assert np.all(errors.rms[:, 1:] < 1e-3)


def test_headings_of_the_table_are_wrapped(tmp_path) -> None:
    experiment = circling(0.2, 0.5)  # 4 rad in all
    write_predictions(tmp_path / "table.csv", predict(experiment, ROBOT, Noise(), 2.0))
    with (tmp_path / "table.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    headings = np.array(
        [[float(row["measured_heading"]), float(row["predicted_heading"])] for row in rows]
    )
    assert headings.min() < -2.0
    assert np.abs(headings).max() <= np.pi
    expected = 0.5 * np.array([float(row["time"]) for row in rows])
    np.testing.assert_allclose(headings[:, 0], np.angle(np.exp(1j * expected)), atol=1e-6)


def test_a_baseline_with_a_lead_knows_nothing_of_what_comes() -> None:
    experiment = circling(0.2, 0.5)
    like = predict(
        experiment, ROBOT, replace(Noise(), wrench=(1.0, 1.0, 0.1), gate_camera=1e9), 2.0, 1.0, 2.0
    )
    frames = experiment.frames[0]
    pose = np.where(
        (frames.t > 2.0)[:, None], 9.0, frames.pose
    )  # the first prediction starts at 2 s
    other = replace(
        like,
        estimates=replace(
            like.estimates, experiment=replace(experiment, frames=(Frames(frames.t, pose),))
        ),
    )
    first = [predict_baseline(constant(), p, HALF_WINDOW).pose[:, 0] for p in (like, other)]
    np.testing.assert_array_equal(*first)
    assert not np.array_equal(*(predict_baseline(constant(), p).pose[:, 0] for p in (like, other)))


def test_a_state_that_knows_a_little_of_what_comes_is_better() -> None:
    random = np.random.default_rng(6)
    commands = np.stack([program(kind, 8.0, random) for kind in ("sines", "steps")], axis=1)
    experiment, truth = record(ROBOT, commands, Noise(), random)
    past, more = (predict(experiment, ROBOT, Noise(), 1.0, 0.5, 2.0, ahead) for ahead in (0.0, 0.5))
    error = [
        np.mean(np.abs(p.pose[0] - truth.state[p.start, p.trial, :3]), axis=0) for p in (past, more)
    ]
    assert np.all(error[1] < [0.8, 0.8, 0.95] * error[0])


def test_baselines_need_some_data() -> None:
    with pytest.raises(ValueError, match=r"too short|no training trial|without a gap"):
        fit_baselines(circling(0.2, 0.5, 0.6))


Array = np.ndarray


def commanded(rotor: Array, rudder: Array) -> Experiment:
    steps = len(rotor)
    nothing = np.full((steps, 1), np.nan)
    frames = (Frames(np.zeros(0), np.zeros((0, 3))),)
    commands = np.stack([rotor, rudder], axis=-1)[:, None]
    return Experiment(
        ("a",),
        np.array([steps]),
        commands,
        nothing,
        np.full((steps, 1, 2), np.nan),
        nothing,
        frames,
        True,
    )


def test_throttle_is_the_share_of_full_strokes_and_a_still_rudder_is_itself_to_the_end() -> None:
    """Full throttle: 12 rad at 2 Hz. The square root of the throttle is the share of its acceleration."""
    t = 0.01 * np.arange(600)
    for share in (1.0, 0.5):
        speed = share * 12.0 * 4.0 * np.pi * np.sin(4.0 * np.pi * t)
        w = inputs(commanded(speed, np.full(600, 0.3)))
        np.testing.assert_allclose(w[100:-100, 0, 0], share, rtol=2e-3)
        np.testing.assert_allclose(w[:, 0, 1], 0.3, rtol=1e-12)


def test_inputs_are_averaged_over_as_much_as_the_stroke_means() -> None:
    """A step of the rudder passes through a half in its middle and is over half a second to both sides."""
    rudder = np.where(np.arange(401) < 200, 0.0, 0.4)
    w = inputs(commanded(np.zeros(401), rudder))[:, 0, 1]
    assert w[150] == pytest.approx(0.0, abs=1e-12)
    assert w[250] == pytest.approx(0.4)
    assert 0.5 * (w[199] + w[200]) == pytest.approx(0.2, abs=1e-9)
    assert np.all(np.diff(w) >= -1e-12)


def excited(step, trials: int = 3, length: int = 60) -> list[Table]:
    """Trials of a system y_k+1 = step(y_k, y_k-1, w_k+1, w_k) under random inputs."""
    random, out = np.random.default_rng(0), []
    for _ in range(trials):
        w = np.column_stack([random.uniform(0.2, 0.8, length), random.uniform(-0.5, 0.5, length)])
        y = np.zeros((length, 3))
        y[:2] = 0.1 * random.standard_normal((2, 3))
        for k in range(1, length - 1):
            y[k + 1] = step(y[k], y[k - 1], w[k + 1], w[k])
        y[:2] = np.nan  # as where the camera does not cover the window
        out.append(Table(y, w))
    return out


def assert_follows(advance, data: list[Table]) -> None:
    for d in data:
        ahead = advance(d.y[3:-1], d.y[2:-2], d.w[4:], d.w[3:-1])
        np.testing.assert_allclose(ahead, d.y[4:], atol=2e-4)


def test_the_linear_model_finds_a_linear_system() -> None:
    random = np.random.default_rng(1)
    A1, A2 = (
        np.diag([0.6, 0.3, 0.4]) + 0.05 * random.standard_normal((3, 3)),
        0.1 * random.standard_normal((3, 3)),
    )
    B1, B2 = 0.1 * random.standard_normal((2, 3, 2))
    c = np.array([0.01, -0.02, 0.03])

    def step(y: Array, before: Array, w: Array, w_before: Array) -> Array:
        return A1 @ y + A2 @ before + B1 @ w + B2 @ w_before + c

    data = excited(step)
    assert_follows(fit_arx(data), data)


def test_the_bilinear_model_finds_a_fish_that_turns_with_rudder_times_speed() -> None:
    def step(y: Array, before: Array, w: Array, w_before: Array) -> Array:
        u = y[0] + STEP * (0.01 - 0.8 * y[0] + 0.3 * 0.5 * (w[0] + w_before[0]))
        r = 0.02 + 1.5 * w[1] * u + 0.7 * w_before[1] * y[0] + 0.3 * y[2]
        return np.array([u, -0.05 * r, r])

    data = excited(step)
    assert_follows(fit_bilinear(data), data)


def test_velocities_of_the_body_add_up_to_a_way_through_the_pool() -> None:
    """Constant surge, sway and turn: the arc in closed form. Rising speed: the mean of both ends."""
    (u, v, r), psi0 = (0.2, 0.05, 0.8), 2.0
    y, start = np.array([[u, v, r]]), np.array([[1.0, -1.0, psi0]])
    x, y_end, psi = _travel(start, y, y)[-1, 0]
    end = psi0 + r * STEP
    assert psi == pytest.approx(end)
    across = (u * (np.sin(end) - np.sin(psi0)) + v * (np.cos(end) - np.cos(psi0))) / r
    up = (-u * (np.cos(end) - np.cos(psi0)) + v * (np.sin(end) - np.sin(psi0))) / r
    assert (x - 1.0, y_end + 1.0) == pytest.approx((across, up), abs=1e-6)
    faster = _travel(np.zeros((1, 3)), np.array([[0.1, 0.0, 0.0]]), np.array([[0.3, 0.0, 0.0]]))
    assert faster[-1, 0] == pytest.approx([0.2 * STEP, 0.0, 0.0])


NOISE = Noise(wrench=(0.1, 0.2, 0.003), gyro=0.2, camera_position=0.004)


def test_noise_and_states_come_back_from_the_file(tmp_path: Path) -> None:
    save_robot(with_noise(Robot(links=1), NOISE, "shooting"), tmp_path / "robot.yaml")
    robot = load_robot(tmp_path / "robot.yaml")
    assert kept_noise(robot) == NOISE
    assert uses_shooting(robot)
    assert robot.digest() == Robot(links=1).digest()


def test_a_robot_without_noise_keeps_none() -> None:
    assert kept_noise(Robot()) is None
    assert not uses_shooting(Robot())


@pytest.mark.parametrize(
    "bad", [{"gyro": -1.0}, {"wrench": [0.1]}, {"nonsense": 1.0}, {"gyro": "0.1"}]
)
def test_noise_that_cannot_be_used_is_refused(bad: dict[str, object]) -> None:
    with pytest.raises(UserError, match=r"prediction\.noise"):
        kept_noise(replace(Robot(), prediction={"noise": bad}))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("prediction: {states: guess}", "filter, shooting"),
        ("prediction: {other: 1}", "known: states, noise, trust"),
        (
            "parameters: {head_mass: {value: 0.465, knowledge: sure}}",
            "measured, estimated, unknown",
        ),
    ],
)
def test_a_file_with_an_unknown_word_is_refused(tmp_path: Path, text: str, said: str) -> None:
    path = tmp_path / "robot.yaml"
    path.write_text("format: 1\n" + text + "\n")
    with pytest.raises(RobotError, match=said):
        load_robot(path)


def test_what_is_known_of_a_parameter_comes_back(tmp_path: Path) -> None:
    robot = replace(Robot(), knowledge={"head_mass": "measured"})
    save_robot(robot, tmp_path / "robot.yaml")
    assert load_robot(tmp_path / "robot.yaml").knowledge == {"head_mass": "measured"}
