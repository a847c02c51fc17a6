# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Scenarios of the blind study: what is drawn, how it is swum, and what the sensors say of it.

A swim ends at the wall: trials are cut there and counted. The second plant swims, turns and drifts as a fish in water does.
"""

from __future__ import annotations

import runpy
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from prove_samples import small

from fish_bag import read_dataset
from fish_control.pool import HALF_LENGTH
from fish_report.errors import UserError
from fish_sim.effects import EFFECTS
from fish_sim.ops import NUMPY
from fish_sim.robot import Robot
from fish_sim.scheme import default_scheme
from fish_sim.sensors import SENSOR_EFFECTS
from fish_sim.sensors.noise_levels import CAMERA_LATENCY
from fish_study import build, scenario_groups
from fish_study.build import FishSimWithImu, make_readings, make_recordings
from fish_study.data_set import write_data_set
from fish_study.mujoco_effects import CONCEALED
from fish_study.mujoco_plant import MujocoPlant, model_text
from fish_study.oracle import as_experiment, with_truth
from fish_study.plant_effects import OTHER_FORMS, OUTSIDE, PLANT_EFFECTS
from fish_study.runner import Job, run_scenario
from fish_study.scenario import Scenario, ScenarioError
from fish_study.score import true_names
from fish_study.study import read_json
from fish_study.swim import (
    Inertial,
    Readings,
    SensorErrors,
    SensorModels,
    ended_at_a_wall,
    kept_trials,
    swim,
)
from fish_study.trials import OpenLoop
from fish_sysid.dataset.experiment import build_experiment
from fish_sysid.dataset.synthetic import FULL_SPEED
from fish_sysid.diagnosis.vocabulary import candidates
from fish_sysid.estimation.ekf_types import Noise
from fish_sysid.estimation.map_fit import evaluate
from fish_sysid.estimation.parametrization import SENSOR_FIELDS


def test_scenarios_are_drawn_from_the_seed_alone() -> None:
    names = list(scenario_groups.GROUPS)
    scenarios = scenario_groups.draw_scenarios(60, names, 7)
    assert (
        scenarios
        == scenario_groups.draw_scenarios(60, names, 7)
        != scenario_groups.draw_scenarios(60, names, 8)
    )
    assert len(scenarios) == 60
    assert {w.group for w in scenarios} == set(names)
    assert [w.group for w in scenarios] != sorted((w.group for w in scenarios), key=names.index)
    assert all(Scenario.of(w.label()) == w for w in scenarios)
    hidden = {
        scenario_groups.single(np.random.default_rng(0), k).names[0]
        for k in range(len(candidates()) + 1)
    }
    assert hidden == {*candidates(), *OTHER_FORMS}
    with pytest.raises(ValueError, match="known: single"):
        scenario_groups.draw_scenarios(3, ["nonsense"], 0)


def test_the_example_s_script_deletes_nothing_that_it_has_not_written(tmp_path: Path) -> None:
    script = Path(__file__).parents[3] / "examples" / "hidden_drag" / "make_recordings.py"
    folder_of = runpy.run_path(str(script))["folder_of"]
    (tmp_path / "thesis.txt").touch()
    with pytest.raises(UserError, match="exists and is not empty"):
        folder_of([str(tmp_path)])
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.txt"]
    assert folder_of([str(tmp_path / "new")]) == tmp_path / "new"
    own = folder_of.__globals__["OWN"]
    assert own == script.parent / "recordings"
    folder_of.__globals__["OWN"] = tmp_path
    assert folder_of([]) == tmp_path
    assert not tmp_path.exists()


def test_no_outside_effect_is_in_the_vocabulary() -> None:
    assert not set(OUTSIDE) & {*candidates(), *EFFECTS}
    assert set(OUTSIDE) < set(PLANT_EFFECTS)


def test_another_form_of_a_name_counts_as_that_name() -> None:
    flow, p = (
        OTHER_FORMS["vortex"].water,
        SimpleNamespace(speed=0.04, at_x=0.3, at_y=-0.1, core=0.5),
    )
    velocity, ((a, b), (c, d)) = flow(p, 0.3, 0.4, None, NUMPY)  # a core above its middle
    assert velocity == pytest.approx((-0.04, 0.0), abs=1e-15)
    assert a + d == pytest.approx(0.0, abs=1e-15)
    h = 1e-6
    up, right = (flow(p, 0.2 + dx, 0.1 + dy, None, NUMPY)[0] for dx, dy in ((0.0, h), (h, 0.0)))
    down, left = (flow(p, 0.2 - dx, 0.1 - dy, None, NUMPY)[0] for dx, dy in ((0.0, h), (h, 0.0)))
    (a, b), (c, d) = flow(p, 0.2, 0.1, None, NUMPY)[1]
    slopes = [(u - v) / (2 * h) for u, v in zip((*right, *up), (*left, *down), strict=True)]
    assert slopes == pytest.approx([a, c, b, d], abs=1e-9)
    scenario = scenario_groups.single(np.random.default_rng(0), len(candidates()))
    assert scenario.names == ("vortex",)
    assert true_names(scenario) == ("nonuniform_current",)
    assert true_names(small("single")) is None


def test_the_hidden_effect_changes_the_motion_and_the_rest_stays() -> None:
    hidden = small("outside", 4)
    without = replace(hidden, effects={})
    a, b, again = (make_readings(w)[0] for w in (hidden, without, hidden))
    assert np.array_equal(a.truth, again.truth)
    assert np.abs(a.truth - b.truth).max() > 1e-3


@pytest.mark.parametrize("name", [*candidates(), *OUTSIDE, *OTHER_FORMS])
def test_an_effect_is_drawn_as_strong_as_asked_and_elsewhere_in_every_scenario(name: str) -> None:
    """Strengths are distances from neutral in typical ones; a limit acts by being small: half as strong is twice as high."""
    effect = {**EFFECTS, **SENSOR_EFFECTS, **OUTSIDE, **OTHER_FORMS}[name]
    drawn = [
        scenario_groups.draw_effect(name, 0.5, np.random.default_rng(seed)) for seed in range(40)
    ]
    signs = set()
    for key, p in effect.parameters.items():
        values = np.array([d[key] for d in drawn])
        assert (p.lowest <= values).all()
        assert (values <= p.highest).all()
        if key in scenario_groups.ELSEWHERE.get(name, {}):
            low, high = scenario_groups.ELSEWHERE[name][key]
            near = 0.2 * (high - low)
            assert low <= values.min() < low + near
            assert high - near < values.max() <= high
        elif key not in effect.strength:
            assert (values == p.value).all()
        elif name in ("rudder_saturation", "rotor_saturation"):
            assert np.all((values >= p.typical / 0.5 / 1.15) & (values <= p.typical / 0.5 / 0.85))
        elif p.typical != p.value:
            share = (values - p.value) / (p.typical - p.value)
            assert np.all(
                (np.abs(share) >= 0.5 * 0.85 - 1e-12) & (np.abs(share) <= 0.5 * 1.15 + 1e-12)
            )
            signs |= set(np.sign(share))
    assert signs <= ({1.0, -1.0} if name in scenario_groups.SIGNED else {1.0})
    assert name not in scenario_groups.SIGNED or signs == {1.0, -1.0}


def test_scenarios_of_a_group_are_what_the_group_says() -> None:
    def drawn(group: str, count: int = 40) -> list[Scenario]:
        return [scenario_groups.GROUPS[group](np.random.default_rng(k), k) for k in range(count)]

    assert {w.trials for w in drawn("feedback")} == {"closed"}
    assert {w.trials for w in drawn("absorbed")} == {"one_speed"}
    assert {w.noise for w in drawn("noise")} == {0.5, 1.0, 2.0, 4.0}
    ladder = drawn("ladder")
    assert {w.strength for w in ladder} == {0.125, 0.25, 0.5, 1.0, 2.0}
    weak = {name for w in ladder if w.strength < 1.0 for name in w.names}
    assert weak.isdisjoint(
        {"rudder_saturation", "rotor_saturation"}
    )  # no command reaches a weak limit
    assert all(len(w.names) == 2 for w in drawn("two"))
    assert not any(w.names for w in drawn("null"))
    assert {w.names[0] for w in drawn("sensor")} == set(SENSOR_FIELDS)
    assert {w.names[0] for w in drawn("outside")} == set(OUTSIDE)
    assert {(w.links, w.method) for w in drawn("null")} >= {(3, "dop853"), (5, "rk4")}
    named = {n: w for w in drawn("single") for n in w.names}
    for name in (
        "rotor_lag",
        "rotor_saturation",
        "battery_sag",
    ):  # an encoder would give the answer away
        assert not named[name].encoder
    encoders = [w.encoder for w in drawn("null")]
    assert 0 < encoders.count(False) < 15
    factors = np.array([f for w in drawn("null") for f in w.parameters.values()])
    assert factors.min() >= 0.75
    assert factors.max() <= 1.25
    assert abs(factors.mean() - 1.0) < 0.02
    assert not {"head_mass", "link_length", "servo_rate_limit"} & set(
        drawn("null", 1)[0].parameters
    )


def of_trials(kind: str) -> list[Readings]:
    return make_readings(replace(small("null"), trials=kind))


def test_trials_are_open_loop_under_feedback_or_at_one_speed() -> None:
    assert [r.commands.shape[1] for r in of_trials("mixed")] == [2, 1]
    (closed,) = of_trials("closed")
    assert closed.commands.shape == (400, 3, 2)
    assert closed.truth.shape == (400, 3, 3)
    (one,) = of_trials("one_speed")
    rotor, second = one.commands[..., 0], slice(100, None)
    assert np.array_equal(rotor[:, 0], rotor[:, 1])
    assert np.array_equal(rotor[:, 0], rotor[:, 2])
    assert np.abs(rotor[second]).max() == pytest.approx(np.sqrt(0.15) * FULL_SPEED, rel=0.01)
    assert not np.array_equal(one.commands[:, 0, 1], one.commands[:, 1, 1])
    np.testing.assert_allclose(  # the phase that is recorded is that of the speed
        rotor[second, 0], np.sqrt(0.15) * FULL_SPEED * np.sin(one.phase[second, 0]), atol=1e-9
    )


def test_the_water_pushes_a_fish_as_long_and_as_hard_as_it_says() -> None:
    """An Ornstein-Uhlenbeck process that is stationary from the start: 3 and 6 mN, 0.15 mN m, for 0.2 s."""
    plant = FishSimWithImu(Robot(), default_scheme(3), 300, 2.0, np.random.default_rng(0))
    first = plant._push
    for _ in range(20):
        plant.step(np.zeros((300, 2)))
    for push in (first, plant._push):
        np.testing.assert_allclose(push.std(axis=0), [0.006, 0.012, 3e-4], rtol=0.15)
    kept = (first * plant._push).mean(axis=0) / (first.std(axis=0) * plant._push.std(axis=0))
    np.testing.assert_allclose(kept, np.exp(-1.0), atol=0.15)


def test_a_program_whose_way_fits_nowhere_is_swum_more_slowly(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    asked = []

    def find_start(way: np.ndarray, *_: object) -> tuple[float, float, float] | None:
        asked.append(way)
        return (0.0, 0.0, 0.0) if len(asked) > 4 else None

    monkeypatch.setattr(build, "find_start", find_start)
    monkeypatch.setattr(
        build,
        "open_loop",
        lambda kinds, duration, random, calm: np.ones((400, len(kinds), 2)) * calm[:, None],
    )
    first, _ = make_readings(small("null"))
    assert first.commands[0, :, 0] == pytest.approx(
        [build.SLOWER**2] * 2
    )  # both fit at the third try


def test_a_program_at_one_speed_is_swum_more_slowly_too(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = []

    def find_start(way: np.ndarray, *_: object) -> tuple[float, float, float] | None:
        asked.append(way)
        return (
            None if len(asked) in (2, 4) else (0.0, 0.0, 0.0)
        )  # the second of three trials, twice

    monkeypatch.setattr(build, "find_start", find_start)
    (one,) = of_trials("one_speed")
    rotor = one.commands[..., 0]
    np.testing.assert_allclose(rotor[:, 1], build.SLOWER**2 * rotor[:, 0])
    assert np.array_equal(rotor[:, 2], rotor[:, 0])
    assert len(asked) == 5


def test_a_fish_that_fits_nowhere_into_the_pool_is_no_scenario(tmp_path: Path, monkeypatch) -> None:
    """It began at the centre and swam through the walls."""
    monkeypatch.setattr(build, "find_start", lambda *_: None)
    with pytest.raises(
        ScenarioError, match="2 of 2 trials of 4 s fit nowhere into the pool, 12 programs tried"
    ):
        make_readings(small("null"))
    run_scenario(Job("a", small("null"), tmp_path, ("false",)))
    assert read_json(tmp_path / "result.json")["error"].startswith("no scenario: 2 of 2 trials")


def test_recordings_say_what_the_instruments_read(tmp_path) -> None:
    scenario = small("single", encoder=True)
    make_recordings(scenario, tmp_path / "set")
    data = read_dataset(tmp_path / "set")
    assert not [p for trial in data for p in trial.problems if p.severity != "info"]
    assert np.diff([trial.origin_ns for trial in data]).min() > 1e9 * scenario.duration
    read, direct = build_experiment(list(data)), as_experiment(make_readings(scenario), True)
    for key in ("commands", "gyro", "accel", "encoder"):
        assert np.allclose(
            getattr(read, key)[:-1],
            getattr(direct, key)[: len(read.commands) - 1],
            atol=1e-9,
            equal_nan=True,
        )
    for a, b in zip(read.frames, direct.frames, strict=True):
        turns = np.round((a.pose - b.pose) / (2.0 * np.pi)) * [
            0.0,
            0.0,
            2.0 * np.pi,
        ]  # a heading may wrap elsewhere
        assert np.allclose(a.t, b.t, atol=1e-8)
        assert np.allclose(a.pose - turns, b.pose, atol=1e-9)
    for trial in data:
        latency = {
            s: np.median(getattr(trial, s).t_arrival - getattr(trial, s).t)
            for s in ("camera", "imu", "encoder")
        }
        assert latency == pytest.approx({"camera": 0.05, "imu": 0.002, "encoder": 0.001}, abs=1e-6)
        turned, rotor = (
            np.diff(trial.encoder.angle),
            0.005 * (trial.encoder.speed[1:] + trial.encoder.speed[:-1]),
        )
        np.testing.assert_allclose(turned, rotor, atol=1e-9)
        yaw = np.unwrap(2.0 * np.arctan2(trial.imu.orientation[:, 2], trial.imu.orientation[:, 3]))
        np.testing.assert_allclose(np.diff(yaw), 0.01 * trial.imu.gyro[1:, 2], atol=1e-9)


def test_recordings_are_as_noisy_as_the_filter_takes_them_to_be() -> None:
    """With the true parameters innovations are white: sensors, biases, the water's push and the true fish all agree."""
    scenario = replace(small("null", encoder=True), count=4, duration=8.0, noise=1.0, seed=3)
    fitting = as_experiment(make_readings(scenario), True)
    hypothesis, theta = with_truth(scenario, ())
    noise = Noise(wrench=(0.003, 0.006, 1.5e-4))
    w = evaluate(hypothesis, theta, fitting, noise).result.whitened
    np.testing.assert_allclose(np.sqrt(np.nanmean(w**2, axis=(0, 1))), 1.0, atol=0.06)
    imu = w[..., :3]
    np.testing.assert_allclose(np.nanmean(imu[1:] * imu[:-1], axis=(0, 1)), 0.0, atol=0.06)


@pytest.mark.parametrize("name", SENSOR_FIELDS)
def test_the_filter_undoes_what_an_instrument_does(name: str) -> None:
    """Likeliest is its true value: not none, and not the opposite one."""
    scenario = small("sensor", list(SENSOR_FIELDS).index(name), noise=1.0)
    read = as_experiment(make_readings(scenario), scenario.encoder)
    hypothesis, theta = with_truth(scenario, scenario.names)
    opposite = 2.0 if name == "camera_latency" else -1.0  # an image cannot be of the future
    likelihoods = []
    for share in (1.0, 0.0, opposite):
        moved = theta.copy()
        moved[-1] *= share
        likelihoods.append(evaluate(hypothesis, moved, read, Noise()).log_likelihood.sum())
    assert likelihoods[0] > max(likelihoods[1:]) + 5.0


def test_noise_scales_with_the_scenario_and_a_hundredth_of_the_frames_is_lost() -> None:
    read = SensorModels(60001, 2, 2.0, SensorErrors(), np.random.default_rng(0))
    zero = np.zeros(2)
    gyro, accel = (
        np.array(v)
        for v in zip(*(read.imu(k, zero, zero, zero) for k in range(20000)), strict=True)
    )
    np.testing.assert_allclose(gyro.std(axis=0), 2.0 * 0.006, rtol=0.03)
    np.testing.assert_allclose(accel.std(axis=0), 2.0 * 0.05, rtol=0.03)
    np.testing.assert_allclose(read.encoder(np.zeros((60001, 2))).std(), 2.0 * 0.15, rtol=0.03)
    np.testing.assert_allclose([len(t) for t in read.stamps], 0.99 * 600.0 * 30.0, rtol=0.005)
    seen = read.poses(0, slice(None), np.zeros((60001, 3)))
    np.testing.assert_allclose(seen.std(axis=0), [0.004, 0.004, 0.024], rtol=0.05)
    periods = np.diff(read.stamps[0])
    assert periods.min() >= 0.0
    assert np.median(periods) == pytest.approx(1 / 30, abs=2e-4)


class Tram:
    """A plant that moves on a line at 0.1 m/s and turns at 0.3 rad/s, its rotor ever faster."""

    def reset(self, poses: np.ndarray) -> None:
        self.k, self.start = 0, np.array(poses)

    def step(self, commands: np.ndarray) -> Inertial:
        self.k += 1
        return Inertial(*(np.full(len(self.start), v) for v in (0.3, 0.02, -0.01)))

    @property
    def pose(self) -> np.ndarray:
        return self.start + 0.01 * self.k * np.array([0.1, 0.0, 0.3])

    @property
    def rotor_speed(self) -> np.ndarray:
        return np.full(len(self.start), 0.5 * self.k)


class Listener:
    """Commands its grid point's number and writes down what it sees."""

    def __init__(self) -> None:
        self.seen: list[tuple[int, int, float]] = []
        self.poses: dict[int, list[Sequence[float]]] = {0: [], 1: []}

    def command(self, k: int) -> tuple[np.ndarray, np.ndarray]:
        return np.full((2, 2), float(k)), np.zeros(2)

    def observe(
        self, k: int, gyro: np.ndarray, accel: np.ndarray, poses: Sequence[Sequence[tuple]]
    ) -> None:
        for m, arrived in enumerate(poses):
            self.seen += [(k, m, stamp) for stamp, *_ in arrived]
            self.poses[m] += [pose for _, *pose in arrived]


def test_a_driver_sees_an_image_when_it_has_arrived_and_the_recording_has_the_same() -> None:
    quiet = SensorModels(
        400,
        2,
        0.0,
        SensorErrors(latency=0.05, scale=1.1, heading_offset=0.2),
        np.random.default_rng(1),
    )
    driver = Listener()
    readings = swim(Tram(), np.array([[0.0, 0.0, 0.0], [1.0, 2.0, 3.0]]), driver, quiet, 400)
    for k, _, stamp in driver.seen:
        assert 0.01 * k < stamp + CAMERA_LATENCY + 1e-9
        assert stamp + CAMERA_LATENCY <= 0.01 * (k + 1) + 1e-9
    for m in range(2):
        count = len(driver.poses[m])
        assert count == (readings.stamps[m] <= 4.0 - CAMERA_LATENCY).sum()
        np.testing.assert_allclose(driver.poses[m], readings.poses[m][:count], atol=1e-12)
        taken = np.maximum(readings.stamps[m] - 0.05, 0.0)
        expected = readings.truth[0, m] + taken[:, None] * [0.1, 0.0, 0.3]
        expected = expected * [1.1, 1.1, 1.0] + [0.0, 0.0, 0.2]
        np.testing.assert_allclose(readings.poses[m], expected, atol=1e-12)
    assert np.array_equal(readings.commands[:, 0, 0], np.arange(400.0))
    assert np.array_equal(
        readings.encoder[:, 1], 0.5 * np.arange(400)
    )  # at the grid point, not a step later
    assert np.ptp(readings.gyro, axis=0) == pytest.approx(0.0, abs=1e-15)  # the truth and a bias
    assert np.abs(readings.gyro - 0.3).max() < 0.02
    assert np.abs(readings.accel - [0.02, -0.01]).max() < 0.15


class Passing:
    """A plant whose first fish goes along x at 0.2 m/s, through the wall; the others stay where they are."""

    def reset(self, poses: np.ndarray) -> None:
        self.pose = np.array(poses, dtype=float)

    def step(self, commands: np.ndarray) -> Inertial:
        self.pose = self.pose.copy()
        self.pose[0, 0] += 0.002
        return Inertial(*np.zeros((3, len(self.pose))))

    @property
    def rotor_speed(self) -> np.ndarray:
        return np.zeros(len(self.pose))


def passed(*starts: float, steps: int = 2000) -> Readings:
    """From places (x, 0) [m]."""
    sensors = SensorModels(steps, len(starts), 1.0, SensorErrors(), np.random.default_rng(0))
    driver = OpenLoop(np.zeros((steps, len(starts), 2)))
    return swim(Passing(), np.array([[x, 0.0, 0.0] for x in starts]), driver, sensors, steps)


def test_a_short_trial_that_no_wall_ends_is_kept() -> None:
    readings = passed(HALF_LENGTH - 0.2, 0.0, steps=200)
    assert list(kept_trials([readings])) == ["trial_01"]
    assert list(ended_at_a_wall([readings])) == ["trial_00"]


def test_a_trial_ends_where_its_fish_comes_to_a_wall(tmp_path: Path) -> None:
    """At 0.2 m/s from 0.999 m before the wall that is after 5 s. The other one is what it would be without the first."""
    readings = passed(HALF_LENGTH - 0.999, 0.5)
    assert readings.ends.tolist() == [500, 2000]
    assert ended_at_a_wall([readings]) == {"trial_00": pytest.approx(5.0)}
    write_data_set(tmp_path / "set", [readings])
    cut, whole = read_dataset(tmp_path / "set").trials
    assert len(cut.commands) == len(cut.imu) == len(cut.encoder) == 500
    assert len(whole.commands) == 2000
    assert cut.camera.t.max() - cut.commands.t[0] < 5.0
    assert cut.camera.x.max() < HALF_LENGTH + 0.02
    experiment = as_experiment([readings], True)
    assert experiment.steps.tolist() == [500, 2000]
    assert experiment.names == ("trial_00", "trial_01")
    assert np.isnan(experiment.gyro[500:, 0]).all()
    assert np.isfinite(experiment.gyro[:, 1]).all()
    assert np.array_equal(experiment.frames[1].t, readings.stamps[1])


def test_a_trial_that_comes_to_a_wall_at_once_is_no_recording(tmp_path: Path) -> None:
    readings = passed(HALF_LENGTH - 0.5, 0.5)
    assert list(kept_trials([readings])) == ["trial_01"]
    assert list(ended_at_a_wall([readings])) == ["trial_00"]
    write_data_set(tmp_path / "set", [readings])
    assert [trial.name for trial in read_dataset(tmp_path / "set")] == ["trial_01"]


def test_a_scenario_says_which_trials_ended_at_a_wall(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(build, "make_readings", lambda _: [passed(HALF_LENGTH - 0.999, 0.5)])
    run_scenario(Job("a", small("null"), tmp_path / "a", ("false",)))
    assert read_json(tmp_path / "a" / "result.json")["ended_at_wall"] == {
        "trial_00": pytest.approx(5.0)
    }
    monkeypatch.setattr(build, "make_readings", lambda _: [passed(HALF_LENGTH - 0.1)])
    run_scenario(Job("b", small("null"), tmp_path / "b", ("false",)))
    assert (
        "no scenario: all 1 trials came to a wall"
        in read_json(tmp_path / "b" / "result.json")["error"]
    )


def test_what_the_second_plant_conceals_is_drawn_in_turn_nothing_included() -> None:
    pytest.importorskip("mujoco")
    scenarios = [
        scenario_groups.mujoco(np.random.default_rng(seed), number)
        for number in range(9)
        for seed in range(8)
    ]
    assert {w.names for w in scenarios} == {(), *((name,) for name in CONCEALED)}
    assert [true_names(w) for w in scenarios if w.names == ("wind",)] == [("current",)] * 8
    assert {true_names(w) for w in scenarios if w.names == ("viscosity",)} == {()}
    wind = np.array([list(w.effects["wind"].values()) for w in scenarios if w.names == ("wind",)])
    factors = wind / list(CONCEALED["wind"].typical.values())
    assert np.allclose(factors[:, 0], factors[:, 1])
    assert set(np.sign(factors[:, 0])) == {1.0, -1.0}
    assert np.all((np.abs(factors) >= 0.85) & (np.abs(factors) <= 1.15))


@pytest.fixture(scope="module")
def basin():
    """The second plant, nothing concealed, still water."""
    pytest.importorskip("mujoco")
    return lambda count, **effects: MujocoPlant(
        model_text(5, {}, effects), count, 0.0, np.random.default_rng(0)
    )


def drive(plant, rudder: np.ndarray, seconds: float) -> np.ndarray:
    """(T, M, 6) motion at 10 to 15 % throttle."""
    plant.reset(np.zeros((len(rudder), 3)))
    rows = []
    for k in range(round(100 * seconds)):
        rotor = min(1.0, 0.01 * k) * 50.0 * np.sin(2.0 * np.pi * 2.0 * 0.01 * k)
        plant.step(np.column_stack([np.full(len(rudder), rotor), rudder]))
        rows.append(plant.motion)
    return np.array(rows)


@pytest.mark.slow
def test_the_second_plant_swims_and_turns_as_the_rudder_says(basin) -> None:
    motion = drive(basin(3), np.array([0.0, 0.5, -0.5]), 6.0)[-200:].mean(axis=0)
    assert 0.05 < motion[0, 3] < 0.3
    assert abs(motion[0, 5]) < 0.02
    assert motion[1, 5] > 0.05
    assert motion[2, 5] < -0.05


def test_the_second_plants_wind_carries_the_fish(basin) -> None:
    plant = basin(1, wind={"x": 0.05, "y": 0.0})
    plant.reset(np.zeros((1, 3)))
    for _ in range(300):
        felt = plant.step(np.zeros((1, 2)))
    assert plant.pose[0] == pytest.approx([0.15, 0.0, 0.0], abs=1e-6)
    assert abs(felt.left[0]) < 1e-6


@pytest.mark.slow
def test_seen_from_the_water_the_second_plant_swims_in_wind_as_in_still_water(basin) -> None:
    """Galilei: whichever way it faces, also at low throttle with the wind from behind."""
    wind, rudder = np.array([0.04, -0.03]), np.array([0.0, 0.1])
    still, blown = (
        drive(p, rudder, 6.0) for p in (basin(2), basin(2, wind={"x": wind[0], "y": wind[1]}))
    )
    carried = 0.01 * np.arange(1, len(blown) + 1)[:, None, None] * wind
    np.testing.assert_allclose(blown[..., :2] - carried, still[..., :2], atol=1e-3)
    np.testing.assert_allclose(blown[..., 2], still[..., 2], atol=1e-2)
    assert (
        blown[-100:, 0, 3].mean() > still[-100:, 0, 3].mean() + 0.03
    )  # from behind: faster over ground


@pytest.mark.slow
def test_a_second_plant_that_is_pushed_backwards_at_the_start_swims_ahead(basin) -> None:
    plant = basin(2)
    plant.reset(np.zeros((2, 3)))
    for data in plant._data:
        data.qvel[0] -= 0.03
    speed = []
    for k in range(600):
        rotor = min(1.0, 0.01 * k) * 50.0 * np.sin(2.0 * np.pi * 2.0 * 0.01 * k)
        plant.step(np.tile([rotor, 0.0], (2, 1)))
        speed.append(plant.motion[:, 3])
    assert np.all(np.mean(speed[-100:], axis=0) > 0.05)
