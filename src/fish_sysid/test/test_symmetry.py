# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Tests of symmetry: what they find, and what becomes of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from swims import World, kinematic_swims

from fish_report.files import plain
from fish_sim.effects import EFFECTS
from fish_sim.model import DT
from fish_sim.robot import Robot
from fish_sysid.dataset.experiment import Experiment
from fish_sysid.dataset.synthetic import with_current, with_image_age
from fish_sysid.diagnosis.change.change import Change
from fish_sysid.diagnosis.change.change_json import changed_robot
from fish_sysid.diagnosis.symmetry.finding import Estimate, Evidence, SymmetryFinding
from fish_sysid.diagnosis.symmetry.findings import GIVEN, symmetry_findings
from fish_sysid.diagnosis.symmetry.outcome import (
    applicable,
    in_still_water,
    stated,
    symmetry_entry,
    with_findings,
    with_symmetry,
)
from fish_sysid.diagnosis.symmetry.regression import evidence
from fish_sysid.reports.diagnosis_page import symmetry_table
from fish_sysid.reports.verdict_sentence import sentence

FLOW = (0.03, -0.02)


def answers(experiment: Experiment, robot: Robot | None = None) -> dict[str, SymmetryFinding]:
    return {f.name: f for f in symmetry_findings(experiment, robot or Robot())}


@pytest.fixture(scope="module")
def null() -> Experiment:
    return kinematic_swims(World())


@pytest.mark.parametrize(
    ("world", "name", "truth", "floor"),
    [
        (World(flow=FLOW), "current", {"x": 0.03, "y": -0.02}, 0.0003),
        (World(gyro_factor=1.05), "gyro_scale", {"factor": 1.05}, 0.001),
        (World(camera_factor=1.1), "camera_scale", {"factor": 1.1}, 0.005),
        (World(imu_angle=0.15), "imu_misalignment", {"angle": 0.15}, 0.005),
        (World(heading_offset=0.08), "camera_heading_offset", {"offset": 0.08}, 0.002),
        (World(shear=0.06), "nonuniform_current", {"shear_x": 0.06, "strain": 0.0}, 0.001),
        (World(encoder_steps=5), "encoder behind the command", {"delay": 0.05}, 0.001),
    ],
)
def test_what_is_hidden_comes_back_within_its_errors(world, name, truth, floor):
    found = answers(kinematic_swims(world, seed=1))[name]
    assert found.status == "found"
    for key, value in truth.items():
        estimate = found.parameters[key]
        assert estimate.value == pytest.approx(value, abs=4.0 * estimate.std + floor)
        assert estimate.std < max(0.3 * abs(value), 0.02)


def read_every(experiment: Experiment, steps: int, first: int = 0) -> Experiment:
    """The experiment with an IMU that is read at every so many grid points alone."""
    lost = np.arange(experiment.length) % steps != first
    gyro, accel = experiment.gyro.copy(), experiment.accel.copy()
    gyro[lost], accel[lost] = np.nan, np.nan
    return replace(experiment, gyro=gyro, accel=accel)


@pytest.mark.parametrize(("steps", "first"), [(1, 0), (2, 0), (2, 1), (3, 1), (5, 0)])
def test_a_slower_and_noisier_imu_tells_the_camera_s_scale(steps, first):
    """The fewer the samples, the more their noise pulls the factor to zero: it is divided by the share that is no noise."""
    made = kinematic_swims(World(camera_factor=1.1), seed=1, trials=12)
    noise = np.random.default_rng(1).standard_normal(made.accel.shape)
    noisy = replace(made, accel=made.accel + 0.15 * noise)
    found = answers(read_every(noisy, steps, first))["camera_scale"]
    assert found.status != "cannot tell"
    factor = found.parameters["factor"]
    assert factor.value == pytest.approx(1.1, abs=3.0 * factor.std + 0.01)
    assert factor.std < 0.07


def test_an_imu_that_misses_strokes_is_said_to_be_too_slow():
    found = answers(read_every(kinematic_swims(World()), 20))["camera_scale"]
    assert found.status == "cannot tell"
    assert "the IMU at 10 Hz or more" in found.reason


def silent(experiment: Experiment, first: float, last: float) -> Experiment:
    """The IMU says nothing for these seconds of every trial."""
    a, b = round(first / DT), round(last / DT)
    gyro, accel = experiment.gyro.copy(), experiment.accel.copy()
    gyro[a:b], accel[a:b] = np.nan, np.nan
    return replace(experiment, gyro=gyro, accel=accel)


@pytest.mark.parametrize(("first", "last"), [(4.0, 6.0), (3.0, 3.4), (8.0, 99.0)])
def test_where_the_imu_pauses_nothing_is_made_up(null, first, last):
    found = answers(silent(null, first, last))
    assert not [f.statement for f in found.values() if f.status == "found"]
    gyro = found["gyro_scale"]
    assert gyro.status == "not found"
    assert gyro.parameters["factor"].value == pytest.approx(1.0, abs=0.01)


def test_a_wrong_scale_is_found_beside_pauses():
    hidden = kinematic_swims(World(gyro_factor=1.05, camera_factor=1.1), seed=1)
    found = answers(silent(hidden, 4.0, 4.5))
    assert found["gyro_scale"].status == "found"
    assert found["gyro_scale"].parameters["factor"].value == pytest.approx(1.05, abs=0.005)
    assert found["camera_scale"].status == "cannot tell"
    assert "without pauses" in found["camera_scale"].reason


def jumping(experiment: Experiment) -> Experiment:
    """Images of the second half of every trial are stamped 1.5 s late."""
    half = 0.5 * DT * len(experiment.commands)
    frames = [replace(f, t=np.where(f.t < half, f.t, f.t + 1.5)) for f in experiment.frames]
    return replace(experiment, frames=tuple(frames))


def without_heading(experiment: Experiment) -> Experiment:
    """A tracker that never sets the heading."""
    flat = [replace(f, pose=f.pose * np.array([1.0, 1.0, 0.0])) for f in experiment.frames]
    return replace(experiment, frames=tuple(flat))


@pytest.mark.parametrize("change", [jumping, without_heading])
def test_camera_and_gyro_that_do_not_turn_together_tell_no_scale(null, change):
    scale = answers(change(null))["gyro_scale"]
    assert scale.status == "cannot tell"
    assert "camera and gyro do not turn together" in scale.reason


def test_a_gain_that_is_no_number_is_no_evidence():
    assert evidence(np.array([np.nan, 1.0, 2.0])).p_value == 1.0


def test_old_images_are_found_and_the_flow_beside_them(null):
    found = answers(with_image_age(with_current(null, FLOW), 0.07))
    assert found["camera_latency"].status == "found"
    assert found["camera_latency"].parameters["delay"].value == pytest.approx(0.07, abs=0.011)
    assert found["current"].status == "found"
    assert found["current"].parameters["x"].value == pytest.approx(0.03, abs=0.001)


@pytest.mark.parametrize("seed", range(50))
def test_nothing_is_stated_where_nothing_is_hidden(seed):
    """Every draw has its own trials, speeds and programs; short ones, of which the least is known."""
    drawn = kinematic_swims(World(), seed=100 + seed, trials=5, duration=10.0)
    assert [f.name for f in symmetry_findings(drawn, Robot()) if f.status == "found"] == []


def test_an_injected_current_moves_the_flow_by_exactly_that(null):
    before, after = answers(null), answers(with_current(null, FLOW))
    for key, step in zip("xy", FLOW, strict=True):
        one, other = before["current"].parameters[key], after["current"].parameters[key]
        assert other.value - one.value == pytest.approx(step, abs=1e-9)
        assert other.std == pytest.approx(one.std, rel=1e-6)
    for name in ("camera_latency", "encoder behind the command", "gyro_scale"):
        assert after[name] == before[name]
    for name in ("camera_scale", "imu_misalignment"):  # a uniform motion is no acceleration
        for key, estimate in before[name].parameters.items():
            assert after[name].parameters[key].value == pytest.approx(estimate.value, abs=1e-9)


def test_a_mirrored_pool_has_a_mirrored_flow():
    """y, heading, rudder and rates change sign: so does the flow across, and nothing else."""
    made = kinematic_swims(World(flow=FLOW), seed=3)
    sides = np.array([1.0, -1.0])
    frames = tuple(replace(f, pose=f.pose * [1.0, -1.0, -1.0]) for f in made.frames)
    mirrored = replace(
        made,
        commands=made.commands * sides,
        gyro=-made.gyro,
        accel=made.accel * sides,
        frames=frames,
    )
    one, other = (answers(e)["current"].parameters for e in (made, mirrored))
    assert other["x"].value == pytest.approx(one["x"].value, abs=1e-6)
    assert other["y"].value == pytest.approx(-one["y"].value, abs=1e-6)


def without(experiment: Experiment, *sensors: str) -> Experiment:
    return replace(experiment, **{s: np.full_like(getattr(experiment, s), np.nan) for s in sensors})


@pytest.mark.parametrize(
    ("world", "lacking", "name", "reason"),
    [
        (World(turns=False, one_heading=True), (), "current", "too few headings"),
        (World(turns=False, one_heading=True), (), "camera_heading_offset", "too few headings"),
        (World(), ("gyro",), "camera_latency", "no gyro"),
        (World(), ("gyro",), "gyro_scale", "no gyro"),
        (World(), ("gyro",), "IMU against the command", "no gyro"),
        (World(), ("accel",), "camera_scale", "no IMU"),
        (World(), ("encoder",), "encoder behind the command", "or the measured speed drives"),
        (World(turns=False, swing=0.0), (), "camera_latency", "no turns"),
        (World(turns=False), (), "gyro_scale", "no turns"),
        (World(turns=False, speeds=(60.0, 60.0)), (), "imu_misalignment", "no turns and one speed"),
        (World(turns=False), (), "left and right differ", "the rudder is left in 0%"),
        (World(speeds=(1.0, 2.0)), (), "camera_heading_offset", "no course"),
        (World(), (), "IMU against the command", "the rotor starts from rest"),
        (World(speeds=(1.0, 2.0)), (), "encoder behind the command", "the rotor changes in fewer"),
        (World(speeds=(1.0, 2.0), turns=False, flow=(0.0, 0.0)), (), "wall_effect", "near a wall"),
    ],
)
def test_what_the_recordings_cannot_tell_is_said_with_the_reason(world, lacking, name, reason):
    found = answers(without(kinematic_swims(world), *lacking))[name]
    assert found.status == "cannot tell"
    assert reason in found.reason
    assert found.needs


def test_a_fish_that_walls_slow_down_is_told_with_how_much():
    swims = kinematic_swims(World(wall=0.5, turns=False), seed=4, trials=8, duration=12.0)
    found = answers(swims)["wall_effect"]
    assert found.status == "found"
    assert found.parameters["slowdown"].value == pytest.approx(0.5, abs=0.15)


def test_walls_are_not_judged_where_the_camera_sees_the_fish_beyond_them(null):
    found = answers(with_current(null, (0.3, 0.0)))["wall_effect"]
    assert found.status == "cannot tell"
    assert "beyond the walls" in found.reason


def test_of_two_trials_nothing_is_told(null):
    for found in symmetry_findings(null.select([0, 1]), Robot()):
        assert found.status == "cannot tell", found.name


def test_a_gyro_that_answers_the_rotor_within_a_stroke_is_in_time():
    late = kinematic_swims(World(wait=1.5))
    assert answers(late)["IMU against the command"].status == "not found"
    early = replace(late, gyro=np.roll(late.gyro, -20, axis=0))
    answer = answers(early)["IMU against the command"]
    assert answer.status == "found"
    assert answer.parameters["answer"].value == pytest.approx(-0.2, abs=0.05)


def test_three_trials_that_answer_early_by_different_times_are_too_few():
    """0.10, 0.14 and 0.18 s before the start: four standard errors from a limit, of which three trials ask for nineteen."""
    late = kinematic_swims(World(wait=1.5), trials=3)
    early = np.stack([np.roll(g, -k) for g, k in zip(late.gyro.T, (10, 14, 18), strict=True)], 1)
    answer = answers(replace(late, gyro=early))["IMU against the command"]
    estimate = answer.parameters["answer"]
    assert estimate.value + 3.0 * estimate.std < -0.05
    assert answer.status == "not found"


def test_mirror_symmetry_alone_names_nothing():
    slipping = without(kinematic_swims(World(heading_offset=0.08), seed=1), "accel")
    findings = symmetry_findings(slipping, Robot())
    found = [f.name for f in findings if f.status == "found"]
    assert found == ["camera_heading_offset", "left and right differ"]
    assert stated(findings) == []


@pytest.mark.parametrize(
    ("world", "names"),
    [
        (World(heading_offset=0.15), ["camera_heading_offset"]),
        (World(imu_angle=0.15), ["imu_misalignment"]),
        (World(heading_offset=0.15, imu_angle=0.2), []),
    ],
)
def test_course_and_accelerometer_together_tell_marker_from_imu(world, names):
    """An angle between the two is the marker's where the course shows the same, the IMU's where it shows none."""
    findings = symmetry_findings(kinematic_swims(world, seed=2, trials=8), Robot())
    assert [f.name for f in stated(findings)] == names


def test_what_the_given_robot_has_is_found_and_not_stated(null):
    robot = Robot().with_effect("current", x=0.03, y=-0.02)
    found = answers(with_current(null, FLOW), robot)["current"]
    assert found.status == "found"
    assert found.reason == GIVEN
    assert stated([found]) == []


def finding(name: str, status: str = "found", **values: float) -> SymmetryFinding:
    parameters = {key: Estimate(value, 1e-3, "") for key, value in values.items()}
    return SymmetryFinding(name, "physics", status, "", "", parameters=parameters)


APPLIED_FLOW = finding("current", x=0.03, y=-0.02)
GYRO = finding("gyro_scale", factor=1.05)


def test_findings_go_into_the_robot_and_what_it_has_stays() -> None:
    robot = with_findings(Robot(), [APPLIED_FLOW, GYRO])
    assert robot.effects["current"] == {"x": 0.03, "y": -0.02}
    assert robot.sensors["gyro_scale"] == {"factor": 1.05}
    has = Robot().with_effect("current", x=0.01, y=0.0)
    assert with_findings(has, [APPLIED_FLOW]).effects["current"] == {"x": 0.01, "y": 0.0}


@pytest.mark.parametrize(
    "one",
    [
        finding("current", "not found", x=0.03, y=-0.02),
        finding("wall_effect", slowdown=0.2),  # no parameter of the effect
        finding("slower or faster in a part of the pool", faster=0.2),
        replace(APPLIED_FLOW, stands_alone=False),
    ],
)
def test_what_is_no_certain_effect_stays_out(one: SymmetryFinding) -> None:
    assert applicable([one], Robot()) == []
    assert with_findings(Robot(), [one]) == Robot()


def test_recordings_in_a_flow_are_fitted_as_the_water_sees_them() -> None:
    still = kinematic_swims(World(), 4, 2)
    back = in_still_water(with_current(still, (0.03, -0.02)), [APPLIED_FLOW])
    for a, b in zip(back.frames, still.frames, strict=True):
        np.testing.assert_allclose(a.pose, b.pose, atol=1e-12)
    assert in_still_water(still, [GYRO]) is still


def test_the_model_of_a_comparison_has_what_old_shows() -> None:
    robot = changed_robot(Change("unchanged", robot=Robot(), symmetry=(APPLIED_FLOW, GYRO)))
    assert robot.effects["current"] == {"x": 0.03, "y": -0.02}
    assert robot.sensors["gyro_scale"] == {"factor": 1.05}


WRITTEN_FLOW = SymmetryFinding(
    "current",
    "physics",
    "found",
    "a steady flow",
    "several headings",
    statement="the water moves by (0.030 ± 0.003, -0.020 ± 0.001) m/s",
    parameters={"x": Estimate(0.03, 0.003, "m/s"), "y": Estimate(-0.02, 0.001, "m/s")},
    evidence=Evidence(0.7, 0.1, 1e-5),
)
BLIND = SymmetryFinding(
    "gyro_scale", "sensor", "cannot tell", "a", "b", reason="no gyro sample can be used"
)


def by_search(name: str) -> dict:
    return {
        "name": name,
        "evidence": {
            "basis": "likelihood",
            "log_likelihood_gain": 90.0,
            "p_value": 0.0,
            "probability": 0.97,
        },
        "parameters": {"x": {"value": 0.028, "std": 0.001, "unit": "m/s"}},
        "rivals": [],
    }


def test_a_finding_that_the_search_does_not_name_is_an_effect_by_symmetry():
    (effect,) = with_symmetry([], (WRITTEN_FLOW, BLIND), EFFECTS)
    assert effect["name"] == "current"
    assert effect["kind"] == "physics"
    assert effect["equation"] == EFFECTS["current"].equation
    assert effect["evidence"]["basis"] == "symmetry"
    assert effect["evidence"]["left_out_log_gain"] == 0.7
    assert effect["evidence"]["p_value"] == 1e-5
    assert effect["parameters"]["y"] == {"value": -0.02, "std": 0.001, "unit": "m/s"}
    assert plain(effect)["share"] is None  # only a model of the fish tells


@pytest.mark.parametrize("name", ["current", "nonuniform_current"])
def test_what_the_search_names_keeps_its_numbers_and_gets_those_of_the_symmetry(name):
    """A flow that varies has a mean: it is the same finding."""
    (effect,) = with_symmetry([by_search(name)], (WRITTEN_FLOW,), EFFECTS)
    assert effect["evidence"]["basis"] == "likelihood"
    assert effect["evidence"]["probability"] == 0.97
    assert effect["parameters"]["x"]["value"] == 0.028
    assert effect["evidence"]["symmetry"]["parameters"]["x"]["value"] == 0.03


def test_without_findings_the_effects_of_the_search_stay_as_they_are():
    before = by_search("tip_slip")
    (after,) = with_symmetry([before], (replace(WRITTEN_FLOW, status="not found"), BLIND), EFFECTS)
    assert after == {**before, "evidence": {**before["evidence"], "basis": "likelihood"}}


def test_only_names_of_the_vocabulary_that_stand_alone_are_stated():
    described = replace(WRITTEN_FLOW, name="slower or faster in a part of the pool")
    assert stated([described, replace(WRITTEN_FLOW, stands_alone=False), BLIND]) == []
    varying = replace(WRITTEN_FLOW, name="nonuniform_current")
    assert [f.name for f in stated([WRITTEN_FLOW, varying])] == ["nonuniform_current"]


def content(effects: list[dict]) -> dict:
    return {
        "verdict": "unexplained",
        "effects": effects,
        "unexplained": {"description": "yaw = (0.001) cos(heading)", "nearest": []},
        "fit": {"tail_links": {"given": 3, "used": 3}, "held_out_trials": ["a"]},
    }


def test_the_sentence_says_what_symmetry_finds_and_what_is_left():
    assert sentence(content(with_symmetry([], (WRITTEN_FLOW,), EFFECTS))) == (
        "The water moves by (0.030 ± 0.003, -0.020 ± 0.001) m/s; beside that "
        "unexplained: yaw = (0.001) cos(heading)."
    )
    both = content(with_symmetry([by_search("tip_slip")], (WRITTEN_FLOW,), EFFECTS))
    both["fit"] |= {"written": "with_effects", "holds": ["tip_slip"]}
    said = sentence({**both, "verdict": "missing_physics"})
    assert said.endswith("model.yaml is without current: not all of its numbers are known.")
    both["fit"]["with_symmetry"] = {"effects": ["tip_slip", "current"]}
    said = sentence({**both, "verdict": "missing_physics"})
    assert said.endswith("model.yaml is without current: with it positions are predicted worse.")
    both["fit"]["holds"] = []
    said = sentence({**both, "verdict": "missing_physics"})
    assert said.endswith("without tip_slip and current: with them positions are predicted worse.")
    both["fit"]["written"] = "refitted"
    said = sentence({**both, "verdict": "missing_physics"})
    assert said.endswith("nothing that was found predicts held-out positions better.")
    said = sentence(
        content(with_symmetry([], (WRITTEN_FLOW,), EFFECTS))
        | {"verdict": "no_mismatch", "ranking": []}
        | {"fit": {**both["fit"], "with_symmetry": None}}
    )
    assert said.endswith("model.yaml is without current: not all of its numbers are known.")
    both["fit"]["holds"] = ["tip_slip", "current"]
    assert "is without" not in sentence({**both, "verdict": "missing_physics"})
    named = content(with_symmetry([by_search("current")], (WRITTEN_FLOW,), EFFECTS))
    assert sentence({**named, "verdict": "missing_physics"}) == (
        "missing_physics: the model lacks current (x 0.028 ± 0.001 m/s; probability 0.97)."
    )


def test_the_page_shows_every_test_with_what_it_assumes_and_needs():
    table = symmetry_table(symmetry_entry((WRITTEN_FLOW, BLIND)))
    assert table.rows[0][:4] == [
        "current",
        "found",
        "x 0.03 ± 0.003 m/s, y -0.02 ± 0.001 m/s",
        "0.70 ± 0.10",
    ]
    assert table.rows[1] == [
        "gyro_scale",
        "cannot tell: no gyro sample can be used",
        "",
        "",
        "a",
        "b",
    ]
