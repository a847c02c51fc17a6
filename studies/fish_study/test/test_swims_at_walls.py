# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""A study's swim ends at the wall: trials are cut there and counted."""

from pathlib import Path

import numpy as np
import pytest
from prove_samples import small

from fish_bag import read_dataset
from fish_control.pool import HALF_LENGTH
from fish_study import build
from fish_study.data_set import write_data_set
from fish_study.oracle import as_experiment
from fish_study.runner import Job, run_scenario
from fish_study.sensor_models import SensorErrors, SensorModels
from fish_study.study import read_json
from fish_study.swim import Inertial, Readings, ended_at_a_wall, kept_trials, swim
from fish_study.trials import OpenLoop


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
