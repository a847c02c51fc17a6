# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The diagnosis finds what was hidden, and nothing where nothing is."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from swims import GIVEN, World, fish, kinematic_swims, swim

from fish_sim.effects import EFFECTS
from fish_sim.effects.hull import QuadraticDrag
from fish_sim.robot import Robot
from fish_sim.robot_file import load_robot, save_robot
from fish_sysid.dataset.synthetic import with_current, with_image_age
from fish_sysid.diagnosis import pipeline
from fish_sysid.diagnosis.can_follow import INTRINSIC, TOO_FAR, missed_by, missed_with
from fish_sysid.diagnosis.conclusion import shares
from fish_sysid.diagnosis.corrected_model import corrected, named
from fish_sysid.diagnosis.diagnosis_json import answer
from fish_sysid.diagnosis.latent_force import dof_shares
from fish_sysid.diagnosis.symmetry.finding import Estimate, SymmetryFinding
from fish_sysid.diagnosis.symmetry.findings import symmetry_findings
from fish_sysid.diagnosis.symmetry.outcome import beyond
from fish_sysid.diagnosis.task import STAGES, make_task
from fish_sysid.diagnosis.vocabulary import NoCandidateError, candidates
from fish_sysid.estimation.ekf_types import Noise
from fish_sysid.estimation.noise_estimation import usual_noise
from fish_sysid.estimation.parametrization import nominal_hypothesis
from fish_sysid.estimation.refit import REFIT, refit
from fish_sysid.estimation.shooting.schedule import misfit
from fish_sysid.reports.diagnosis_page import write_diagnosis_page
from fish_sysid.reports.verdict_sentence import sentence

pytestmark = pytest.mark.timeout(1200)  # of a loaded computer; seconds each on a quiet one

FEW = ("quadratic_drag", "current", "rudder_offset", "camera_latency")


def test_nothing_is_found_where_nothing_is(tmp_path):
    result = pipeline.diagnose(swim(fish()), GIVEN, names=FEW)
    content = answer(result)
    assert content["verdict"] == "no_mismatch"
    assert content["effects"] == []
    write_diagnosis_page(tmp_path / "report.html", "null", content, result)
    page = (tmp_path / "report.html").read_text()
    assert f"none of the {len(FEW)} candidates tried (of {len(candidates())}) is needed" in page


def test_a_tail_of_more_links_is_no_missing_physics(tmp_path):
    said: list[str] = []
    data = swim(fish(2), duration=4.0)
    result = pipeline.diagnose(data, GIVEN, progress=said.append, names=("quadratic_drag",))
    content = answer(result)
    assert content["verdict"] == "no_mismatch"
    assert content["fit"]["tail_links"] == {"given": 1, "used": 2}
    tried = [text for text in said if "tail links" in text]  # two leave no more than water
    assert tried == ["fitting the nominal model with 2 tail links"]
    write_diagnosis_page(tmp_path / "report.html", "finer", content, result)
    assert "modelled with 2 links instead of 1" in (tmp_path / "report.html").read_text()


def test_a_hidden_current_is_named_with_its_size(tmp_path):
    data = swim(fish(current={"x": 0.03, "y": -0.02}), duration=7.0)
    result = pipeline.diagnose(data, GIVEN, names=FEW)
    content = json.loads(json.dumps(answer(result), default=float))
    assert content["verdict"] == "missing_physics"
    assert [e["name"] for e in content["effects"]] == ["current"]
    found = content["effects"][0]["parameters"]
    assert found["x"]["value"] == pytest.approx(0.03, abs=max(4 * found["x"]["std"], 0.004))
    assert found["y"]["value"] == pytest.approx(-0.02, abs=max(4 * found["y"]["std"], 0.004))
    assert sum(content["effects"][0]["where"]["dof"].values()) == pytest.approx(1.0)
    fit = content["fit"]
    density = "log_density_per_sample"
    assert fit["with_effects"][density] > fit["refitted"][density]
    write_diagnosis_page(tmp_path / "report.html", "current", content, result)
    page = (tmp_path / "report.html").read_text()
    for title in ("What is missing: current", "The water with current"):
        assert f"<h2>{title}</h2>" in page
    assert "When current acts" not in page  # it acts all the time
    saved = result.final.robot.without_effect("disturbance"), tmp_path / "model.yaml"
    save_robot(*saved, result.final.standard_errors, sentence(content))
    loaded = load_robot(tmp_path / "model.yaml").effects["current"]
    assert loaded["x"] == pytest.approx(found["x"]["value"])


def test_effects_of_the_given_robot_are_refitted_and_no_other_name_takes_their_place(tmp_path):
    """A rudder whose offset is larger than robot.yaml says is no asymmetry of the hull."""
    given = GIVEN.with_effect("rudder_offset", offset=0.06)
    names = ("hull_asymmetry", "camera_heading_offset", "rudder_offset")
    result = pipeline.diagnose(swim(fish(rudder_offset={"offset": 0.09})), given, names=names)
    content = answer(result)
    assert content["verdict"] == "no_mismatch"
    reason = "the given robot has it, and its values are refitted"
    assert content["out_of_reach"] == {"rudder_offset": reason}
    fit = corrected(result)
    found, error = (table["rudder_offset.offset"] for table in (fit.values, fit.standard_errors))
    assert found == pytest.approx(0.09, abs=4 * error)
    assert error < 0.003
    write_diagnosis_page(tmp_path / "report.html", "given", content, result)
    page = (tmp_path / "report.html").read_text()
    for text in ("own effects</h2>", "what the given model lacks"):
        assert text in page


def test_a_late_camera_is_not_called_physics():
    data = swim(fish())
    late = replace(data, frames=tuple(replace(f, t=f.t + 0.05) for f in data.frames))
    result = pipeline.diagnose(late, GIVEN, names=FEW)
    assert [a.name for a in result.accepted] == ["camera_latency"]
    assert answer(result)["verdict"] == "sensor_or_actuator"


class Mine(QuadraticDrag):
    """An effect of a user's own."""

    name = "mine"


def test_an_effect_of_ones_own_is_found_without_touching_the_table():
    before, effects = dict(EFFECTS), {**EFFECTS, "mine": Mine}
    hidden = replace(fish(), table=effects).with_effect("mine", surge=0.6, sway=4.0, yaw=1.2e-3)
    result = pipeline.diagnose(swim(hidden, duration=5.0), GIVEN, names=("mine",), effects=effects)
    assert [e["name"] for e in answer(result)["effects"]] == ["mine"]
    assert before == EFFECTS


def test_names_that_cannot_be_judged_are_no_candidates_and_without_one_the_reasons_are_given():
    still = swim(GIVEN, kinds=("straight",), duration=1.0)
    with pytest.raises(NoCandidateError, match=r"could be judged \(rudder_lag: the rudder never"):
        pipeline.diagnose(still, GIVEN, names=["rudder_lag"])
    given = GIVEN.with_effect("current", x=0.03)
    with pytest.raises(NoCandidateError, match="current: the given robot has it"):
        pipeline.diagnose(still, given, names=["current"])


def test_only_the_training_trials_decide_what_can_be_judged():
    """Of three trials the third is held out: there the rudder moves."""
    data = swim(GIVEN, kinds=("straight", "straight", "sines"), duration=1.0)
    with pytest.raises(NoCandidateError, match="rudder_lag: the rudder never moved"):
        pipeline.diagnose(data, GIVEN, names=["rudder_lag"])


def test_only_known_names_compete():
    with pytest.raises(ValueError, match="unknown candidate 'magic'; known: quadratic_drag"):
        pipeline.diagnose(swim(GIVEN, duration=1.0), GIVEN, names=["magic"])


@pytest.mark.parametrize("stage", [name for name, _ in STAGES])
def test_every_stage_can_be_switched_off(stage):
    task = make_task(swim(GIVEN, duration=1.0), GIVEN, without={stage})
    assert [name for name, _ in STAGES if not task.runs(name)] == [stage]


def test_the_answer_is_the_same_without_the_stages_that_have_not_changed_the_search():
    data = swim(fish(current={"x": 0.03, "y": -0.02}), kinds=("sines", "steps"), duration=3.0)
    names = ("current", "rudder_offset")
    whole = pipeline.diagnose(data, GIVEN, names=names)
    idle = {name for name, _ in STAGES} - whole.task.acted
    assert {"model order", "can the model follow"} <= idle
    assert whole.task.acted < {name for name, _ in STAGES}
    without = pipeline.diagnose(data, GIVEN, names=names, without=idle)
    assert json.dumps(answer(without)) == json.dumps(answer(whole))


def test_an_unknown_stage_is_refused():
    data = swim(GIVEN, duration=1.0)
    with pytest.raises(ValueError, match="stage 'magic': expected one of annealed screening, "):
        pipeline.diagnose(data, GIVEN, without={"magic"})
    with pytest.raises(ValueError, match="stage 'magic'"):
        make_task(data, GIVEN).runs("magic")


def test_without_the_check_and_the_model_order_the_answer_is_still_whole():
    data = swim(fish(current={"x": 0.03, "y": -0.02}), kinds=("sines", "steps"), duration=3.0)
    names, off = ("current",), {name for name, _ in STAGES}
    result = pipeline.diagnose(data, GIVEN, names=names, without=off)
    assert [a.name for a in result.accepted] == ["current"]
    assert answer(result)["fit"]["errors_are_of"] == "training"


def test_where_the_model_cannot_follow_the_fish_no_name_is_searched_for(tmp_path):
    """Images shake by 5 cm, which no start state, parameter or effect of a fish explains."""
    data = swim(fish(), duration=7.0)
    shaken = []
    for frames in data.frames:
        pose = frames.pose.copy()
        pose[:, :2] += 0.05 * np.sin(6.0 * frames.t)[:, None]
        shaken.append(replace(frames, pose=pose))
    result = pipeline.diagnose(replace(data, frames=tuple(shaken)), GIVEN, names=FEW)
    content = answer(result)
    assert content["verdict"] == "unexplained"
    assert content["ranking"] == []
    said = sentence(content)
    assert "from no start state does the model follow two seconds of swimming" in said
    write_diagnosis_page(tmp_path / "report.html", "shaken", content, result)
    assert "no name is searched for" in (tmp_path / "report.html").read_text()


def test_a_model_that_lacks_a_strong_current_can_follow_the_fish():
    task = make_task(swim(fish(current={"x": 0.06, "y": -0.05}), duration=7.0), GIVEN)
    assert missed_by(task) is None


def test_a_model_that_lacks_a_flow_which_varies_over_the_pool_can_follow_the_fish():
    """A uniform flow alone leaves more than twice the camera's noise."""
    swirl = {"shear_x": 0.4, "shear_y": -0.4}
    quiet = Noise(gyro=0.003, accel=0.025, camera_position=0.0006, camera_heading=0.003)
    data = swim(fish(nonuniform_current=swirl), duration=7.0, noise=quiet)
    task = make_task(data, GIVEN)
    assert missed_with([*INTRINSIC, "current"], GIVEN, task) > TOO_FAR
    assert missed_by(task) is None


def test_a_model_that_states_the_age_of_its_images_can_follow_the_fish():
    """It would otherwise miss by thirteen times the camera's noise: its clock could move by 0.08 s alone."""
    robot = fish().with_effect("camera_latency", delay=0.16)
    late = with_image_age(swim(fish(), duration=7.0), 0.16)
    noise = usual_noise(late)
    assert misfit(late, robot, noise, ("head_drag_surge",)) < 1.5
    assert misfit(late, fish(), noise, ("head_drag_surge",)) > TOO_FAR


def test_numbers_of_a_symmetry_in_the_model_know_no_held_out_trial():
    """The flow is another one in the trials that score the model."""
    still = kinematic_swims(World(), trials=12)
    flows = [with_current(still, (x, 0.0)) for x in (0.05, 0.08)]
    frames = tuple(flows[m % 3 == 2].frames[m] for m in range(12))
    task = make_task(replace(still, frames=frames), Robot())
    symmetry = symmetry_findings(task.experiment, task.robot)
    told, known = (
        next(f for f in findings if f.name == "current").parameters["x"].value
        for findings in (symmetry, pipeline.of_training(symmetry, task))
    )
    assert told == pytest.approx(0.06, abs=0.003)
    assert known == pytest.approx(0.05, abs=0.001)


def test_of_two_effects_each_has_its_own_place():
    robot = fish(hull_asymmetry={"sway": 0.0, "yaw": 0.2}, tether={"stiffness": 0.6, "length": 0.0})
    experiment = swim(robot, duration=7.0)
    final = refit(nominal_hypothesis(robot, ()), np.zeros(0), experiment, Noise(), REFIT)
    names = ["hull_asymmetry", "tether"]
    parts = shares(final, names, experiment)
    yaw = {name: dof_shares(less, final)["yaw"] for name, (less, _) in parts.items()}
    assert yaw["hull_asymmetry"] > 0.5
    assert yaw["tether"] < 0.3
    assert set(parts["tether"][0].hypothesis.names) == {"hull_asymmetry"}
    assert shares(final, names[:1], experiment) == {}  # the refitted nominal model lacks it


def test_what_only_symmetry_finds_stands_in_the_model_with_what_the_search_names(tmp_path) -> None:
    """A flow, which is no candidate here, bends the fit of the rudder's offset; with the symmetry's flow both are right."""
    flow = {"x": 0.03, "y": -0.02}
    data = swim(fish(current=flow, rudder_offset={"offset": 0.08}), duration=7.0)
    result = pipeline.diagnose(data, GIVEN, names=("rudder_offset",))
    assert [a.name for a in named(result)] == ["rudder_offset"]
    estimates = {key: Estimate(value, 0.002, "m/s") for key, value in flow.items()}
    found = SymmetryFinding("current", "physics", "found", "", "", parameters=estimates)
    both = replace(result, settled=pipeline.with_symmetry_found(result, [found]))
    fit = corrected(both)
    assert fit is both.settled
    assert fit.robot.effects["current"] == pytest.approx(flow)
    wrong, right = (f.values["rudder_offset.offset"] for f in (result.final, fit))
    assert abs(right - 0.08) < min(0.02, abs(wrong - 0.08))
    content = answer(both)
    assert content["fit"]["written"] == "with_symmetry"
    assert content["fit"]["with_symmetry"]["effects"] == ["current", "rudder_offset"]
    (effect,) = content["effects"]  # its numbers are those of model.yaml
    assert effect["parameters"]["offset"]["value"] == right
    write_diagnosis_page(tmp_path / "report.html", "both", content, both)
    page = (tmp_path / "report.html").read_text()
    assert "with what symmetry tests find, in all current, rudder_offset (model.yaml)" in page
    assert beyond(("nonuniform_current",), [found]) == []  # a flow that varies has a mean
    assert beyond(("tip_slip",), [found]) == [found]
