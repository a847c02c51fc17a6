"""The diagnosis finds what was hidden, and nothing where nothing is."""

from __future__ import annotations

import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from fish_sim.effects import EFFECTS
from fish_sim.robot import Robot, load_robot, save_robot
from fish_sim.sensors import SENSOR_EFFECTS
from fish_sysid.dataset.synthetic import program, record
from fish_sysid.diagnosis import (
    backward_elimination,
    model_order,
    pipeline,
    refit,
    screening,
)
from fish_sysid.diagnosis import corrected_model as verdicts
from fish_sysid.diagnosis import diagnosis_json as answers
from fish_sysid.diagnosis.diagnosis_json import answer
from fish_sysid.diagnosis.latent_force import dof_shares
from fish_sysid.diagnosis.model_order import with_links
from fish_sysid.diagnosis.next_experiment import next_experiment
from fish_sysid.diagnosis.residual_regression import Description
from fish_sysid.diagnosis.result import Accepted
from fish_sysid.diagnosis.significance import Level, probabilities
from fish_sysid.diagnosis.trial_split import (
    Trials,
    excitation,
    split_trials,
    trials_of,
)
from fish_sysid.diagnosis.vocabulary import (
    NoCandidateError,
    candidates,
    kind_of,
    known,
    out_of_reach,
)
from fish_sysid.estimation.ekf_types import Noise
from fish_sysid.estimation.map_fit import evaluate
from fish_sysid.estimation.noise_estimation import settle
from fish_sysid.estimation.parametrization import nominal_hypothesis
from fish_sysid.reports.diagnosis_page import write_diagnosis_page
from fish_sysid.reports.verdict_sentence import sentence
from fish_sysid.verbs.diagnose import without_wrench

VOCABULARY = """quadratic_drag current nonuniform_current wall_effect tip_slip wake_memory wave_drag sloshing hull_asymmetry
tail_hardening tail_joint_damping dry_friction tether payload rotor_imbalance rudder_lag rudder_delay rudder_backlash
rudder_offset rudder_saturation rudder_gain rudder_placement rotor_lag rotor_saturation battery_sag camera_latency
camera_heading_offset camera_scale gyro_scale imu_misalignment""".split()
FEW = (
    "quadratic_drag",
    "current",
    "rudder_offset",
    "camera_latency",
)  # enough rivals for a test of a minute


def swim(robot: Robot, seed: int = 0, kinds=("sines", "steps", "random"), duration: float = 7.0):
    random = np.random.default_rng(seed)
    commands = np.stack([program(kind, duration, random) for kind in kinds], axis=1)
    return record(robot, commands, Noise(), random)[0]


def truth(**effects) -> Robot:
    robot = Robot()
    return Robot(
        parameters={
            **robot.parameters,
            "head_drag_surge": 0.26,
            "tail_stiffness": 0.11,
            "head_drag_sway": 1.2,
        },
        effects=effects,
    )


def test_the_vocabulary_is_complete_and_every_name_has_a_kind():
    assert set(VOCABULARY) == set(candidates())
    assert {kind_of(name) for name in VOCABULARY} == {"physics", "actuator", "sensor"}


def test_nothing_is_found_where_nothing_is(tmp_path):
    result = pipeline.diagnose(swim(truth()), Robot(), names=FEW)
    content = answer(result)
    assert content["verdict"] == "no_mismatch"
    assert content["effects"] == []
    write_diagnosis_page(tmp_path / "report.html", "null", content, result)
    page = (tmp_path / "report.html").read_text()
    assert f"none of the {len(FEW)} candidates tried (of {len(candidates())}) is needed" in page


def test_a_tail_of_more_links_is_no_missing_physics(tmp_path):
    fish = swim(with_links(truth(), 4), duration=5.0)
    result = pipeline.diagnose(fish, Robot(), names=("quadratic_drag", "payload"))
    content = answer(result)
    assert content["verdict"] == "no_mismatch"
    assert content["fit"]["tail_links"] == {"given": 3, "used": 4}
    write_diagnosis_page(tmp_path / "report.html", "finer", content, result)
    assert "modelled with 4 links instead of 3" in (tmp_path / "report.html").read_text()


@pytest.mark.parametrize(
    ("gain", "left", "accepted"), [(20.0, 2.0, True), (5.0, 2.0, False), (20.0, 14.0, False)]
)
def test_a_finer_tail_must_gain_on_unseen_trials_but_not_what_the_truth_would(
    monkeypatch, gain, left, accepted
):
    nominal = SimpleNamespace(objective=0.0, result=SimpleNamespace(samples=np.array([1000.0])))
    finer = SimpleNamespace(objective=500.0, robot=SimpleNamespace(links=4))
    monkeypatch.setattr(
        model_order, "excess", lambda fit: np.array([left if fit is finer else 10.0])
    )
    monkeypatch.setattr(model_order, "shorten", lambda *_: None)
    monkeypatch.setattr(model_order, "finer_tails", lambda *_: [finer])
    monkeypatch.setattr(model_order, "evidence", lambda fit: fit.objective)
    monkeypatch.setattr(model_order, "on_all", lambda fit, _: fit)
    monkeypatch.setattr(model_order, "gain_unseen", lambda *_: (gain, 1000.0))
    monkeypatch.setattr(model_order, "reheat", lambda fit, _: fit)
    law = Description({}, {}, 1e4)
    found = model_order.finer_tail(
        nominal, nominal, law, None, Trials(None, None, (0,)), Level(), lambda _: None
    )
    assert found is (finer if accepted else None)


@pytest.mark.parametrize(("left", "led"), [(9.0, True), (3.0, False)])
def test_a_fit_that_leaves_far_more_on_more_trials_is_led_once_more(monkeypatch, left, led):
    fit = SimpleNamespace(hypothesis=None, theta=None, noise=None, left=2.0)
    monkeypatch.setattr(refit, "evaluate", lambda *_: None)
    monkeypatch.setattr(refit, "settle_base", lambda *_: SimpleNamespace(left=left))
    monkeypatch.setattr(refit, "excess", lambda f: np.array([f.left]))
    monkeypatch.setattr(refit, "anneal", lambda *_: "led")
    assert (refit.refine(fit, None) == "led") is led


def test_a_tail_cut_finer_weighs_and_bends_as_before():
    fine = with_links(truth(), 5)
    for name in ("link_length", "link_mass", "link_drag_sway"):
        assert 5 * fine.parameters[name] == pytest.approx(3 * truth().parameters[name])
    assert fine.parameters["tail_stiffness"] / 5 == pytest.approx(
        truth().parameters["tail_stiffness"] / 3
    )


def test_a_hidden_current_is_named_with_its_size(tmp_path):
    result = pipeline.diagnose(swim(truth(current={"x": 0.03, "y": -0.02})), Robot(), names=FEW)
    content = json.loads(json.dumps(answer(result), default=float))
    assert content["verdict"] == "missing_physics"
    assert [e["name"] for e in content["effects"]] == ["current"]
    found = content["effects"][0]["parameters"]
    assert found["x"]["value"] == pytest.approx(0.03, abs=max(4 * found["x"]["std"], 0.004))
    assert found["y"]["value"] == pytest.approx(-0.02, abs=max(4 * found["y"]["std"], 0.004))
    assert sum(content["effects"][0]["where"]["dof"].values()) == pytest.approx(1.0)
    assert (
        content["fit"]["with_effects"]["log_density_per_sample"]
        > content["fit"]["refitted"]["log_density_per_sample"]
    )
    write_diagnosis_page(tmp_path / "report.html", "current", content, result)
    page = (tmp_path / "report.html").read_text()
    for title in ("What is missing: current", "The water with current"):
        assert f"<h2>{title}</h2>" in page
    assert "When current acts" not in page  # it acts all the time
    save_robot(
        without_wrench(result.final.robot),
        tmp_path / "model.yaml",
        result.final.standard_errors,
        sentence(content),
    )
    assert load_robot(tmp_path / "model.yaml").effects["current"]["x"] == pytest.approx(
        found["x"]["value"]
    )


def test_what_the_given_robot_has_is_refitted_and_no_other_name_takes_its_place(tmp_path):
    """A rudder that stands askew by more than robot.yaml says is no asymmetry of the hull."""
    given = Robot().with_effect("rudder_offset", offset=0.06)
    names = ("hull_asymmetry", "camera_heading_offset", "rudder_offset")
    result = pipeline.diagnose(swim(truth(rudder_offset={"offset": 0.09})), given, names=names)
    content = answer(result)
    assert content["verdict"] == "no_mismatch"
    assert content["out_of_reach"] == {
        "rudder_offset": "the given robot has it, and its values are refitted"
    }
    fit = verdicts.corrected(result)
    found, error = (table["rudder_offset.offset"] for table in (fit.values, fit.standard_errors))
    assert found == pytest.approx(0.09, abs=4 * error)
    assert error < 0.002
    save_robot(
        without_wrench(fit.robot), tmp_path / "model.yaml", fit.standard_errors, sentence(content)
    )
    assert load_robot(tmp_path / "model.yaml").effects["rudder_offset"]["offset"] == pytest.approx(
        found
    )
    write_diagnosis_page(tmp_path / "report.html", "given", content, result)
    page = (tmp_path / "report.html").read_text()
    for text in ("own effects</h2>", "what the given model lacks"):
        assert text in page


def test_a_payload_is_found_on_the_side_where_it_is():
    """The fit starts on all sides; only mass times place is determined, which must not count against the name."""
    hidden = {"mass": 0.12, "forward": -0.08, "left": 0.02}
    result = pipeline.diagnose(
        swim(truth(payload=hidden)), Robot(), names=("payload", "camera_scale")
    )
    assert [a.name for a in result.accepted] == ["payload"]
    found = result.final.values
    moment = found["payload.mass"] * found["payload.forward"]
    assert moment == pytest.approx(hidden["mass"] * hidden["forward"], rel=0.15)


def test_a_late_camera_is_not_called_physics():
    late = swim(truth())
    shifted = tuple(type(f)(f.t + 0.05, f.pose) for f in late.frames)
    result = pipeline.diagnose(
        type(late)(**{**late.__dict__, "frames": shifted}), Robot(), names=FEW
    )
    assert [a.name for a in result.accepted] == ["camera_latency"]
    assert answer(result)["verdict"] == "sensor_or_actuator"


def test_a_law_that_holds_on_unseen_trials_is_told_for_every_degree_of_freedom_that_has_one():
    gain = {"surge": 10.0, "sway": 90.0, "yaw": 300.0}
    terms = {
        "surge": {},
        "sway": {"time sway_speed": -0.05},
        "yaw": {"cos(heading)": 1e-3, "rudder": 2e-4},
    }
    description = Description(gain, terms, 1e4)
    assert description.lawful(Level()) == ["yaw", "sway"]
    assert description.lawful(Level(false_alarms=1e-11)) == ["yaw"]  # 4 log(3e11) = 106 nats
    assert (
        Description(gain, terms, 1e6).lawful(Level()) == []
    )  # too little for so many measurements
    assert answers.law(SimpleNamespace(description=description), "yaw").startswith(
        "yaw = (0.001) cos(heading) + (0.0002) rudder (SI units; 300 nats"
    )


@pytest.mark.parametrize(
    ("times_water", "gain", "much"), [(2.0, 300.0, True), (5.0, 10.0, False), (40.0, 10.0, True)]
)
def test_much_is_left_where_it_is_far_more_than_water_or_follows_a_law(
    monkeypatch, times_water, gain, much
):
    monkeypatch.setattr(verdicts, "excess", lambda _: np.array([1.0, times_water, 0.5]))
    found = SimpleNamespace(
        level=Level(), final=None, description=Description({"sway": gain}, {}, 1e4)
    )
    assert verdicts.much_is_left(found) is much


@pytest.mark.parametrize(
    ("left", "searched", "training", "tried"),
    [(1.0, 5.0, 5.0, 0), (1.0, 300.0, 5.0, 1), (1.0, 5.0, 300.0, 1), (9.0, 5.0, 5.0, 1)],
)
def test_finer_tails_are_tried_where_much_is_left_or_follows_a_law(
    monkeypatch, left, searched, training, tried
):
    calls, law = [], Description({"yaw": training}, {}, 1e4)
    monkeypatch.setattr(model_order, "excess", lambda _: np.array([left]))
    monkeypatch.setattr(model_order, "describe", lambda *_: Description({"yaw": searched}, {}, 1e4))
    monkeypatch.setattr(model_order, "shorten", lambda *_: None)
    monkeypatch.setattr(model_order, "finer_tails", lambda *_: calls.append(1) or [])
    assert (
        model_order.finer_tail(
            None, None, law, None, Trials(None, None, ()), Level(), lambda _: None
        )
        is None
    )
    assert len(calls) == tried


WATER = {-0.5: 4.0, -0.25: 10.0}  # that fits of these objectives leave; others leave 15


@pytest.mark.parametrize(
    ("cold", "led", "held", "settled", "tried", "kept"),
    [
        ({4: 5.0, 5: 9.0}, {4: 1.0, 5: 1.0}, {}, {}, [4, 5], [5.0, 9.0]),
        ({4: -5.0, 5: 9.0}, {4: -1.0, 5: 1.0}, {4: -2.0}, {}, [4], [-1.0]),
        ({4: -5.0, 5: 1.0}, {4: 3.0, 5: 8.0}, {}, {}, [4, 5], [3.0, 8.0]),
        ({4: -5.0, 5: 9.0}, {4: -1.0, 5: 1.0}, {4: 2.0}, {}, [4, 5], [2.0, 9.0]),
        ({4: -5.0, 5: 9.0}, {4: -1.0, 5: 1.0}, {}, {-1.0: 6.0}, [4, 5], [6.0, 9.0]),
        ({4: -5.0, 5: 9.0}, {4: -1.0, 5: 1.0}, {4: 2.0}, {2.0: -7.0}, [4], [-1.0]),
        ({4: -5.0, 5: 9.0}, {4: -0.5, 5: 1.0}, {}, {}, [4, 5], [-0.5, 9.0]),
        ({4: -5.0, 5: 9.0}, {4: -0.25, 5: 1.0}, {4: -2.0}, {}, [4], [-0.25]),
    ],
)
def test_another_link_is_tried_where_the_one_before_gained_on_whole_trials_or_leaves_little_water(
    monkeypatch, cold, led, held, settled, tried, kept
):
    fewer, further = SimpleNamespace(theta="fewer", objective=0.0), held
    calls = []

    def reaches(objective):
        return SimpleNamespace(objective=objective)

    fewer.hypothesis = SimpleNamespace(free=("head_inertia", "rudder_offset.offset"))

    def finer(links, free):
        assert free == fewer.hypothesis.free  # of the robot's own effects as well
        return links

    def many_fit(links, *_args, places):
        calls.append(links)
        assert places == ("fewer",)
        return reaches(cold[links])

    def led_fit(links, _experiment, _noise, theta="nominal", held=()):
        assert (theta, held) in (("fewer", ()), ("nominal", model_order.TAIL_INERTIAS))
        return reaches(further[links] if held else led[links])

    def on_whole(fit, experiment):
        assert experiment == "whole"
        return reaches(settled.get(fit.objective, fit.objective))

    monkeypatch.setattr(model_order, "usual_noise", lambda _: None)
    monkeypatch.setattr(model_order, "with_links", lambda _, links: links)
    monkeypatch.setattr(model_order, "nominal_hypothesis", finer)
    monkeypatch.setattr(model_order, "fit_multistart", many_fit)
    monkeypatch.setattr(model_order, "fit_tempered", led_fit)
    monkeypatch.setattr(model_order, "carry_over", on_whole)
    monkeypatch.setattr(
        model_order, "excess", lambda fit: np.array([WATER.get(fit.objective, 15.0)])
    )
    found = model_order.finer_tails(Robot(), fewer, fewer, "whole", "short", lambda _: None)
    assert [fit.objective for fit in found] == kept
    assert calls == tried


def test_what_the_data_cannot_say_is_said():
    still = swim(Robot(), kinds=("straight", "straight"), duration=2.0)
    reasons = out_of_reach(still)
    unseen = {name for name, why in reasons.items() if why == "the rudder never moved"}
    assert {"rudder_lag", "rudder_gain", "rudder_placement"} <= unseen
    assert "rudder_offset" not in reasons
    assert "current" not in reasons
    blind = type(still)(**{**still.__dict__, "gyro": np.full_like(still.gyro, np.nan)})
    assert out_of_reach(blind)["gyro_scale"] == "no IMU was recorded"
    drifting = type(still)(**{**still.__dict__, "commands": still.commands * [0.0, 1.0]})
    told = {name for name, why in out_of_reach(drifting).items() if why == "the rotor never moved"}
    assert told == {"rotor_lag", "rotor_saturation", "battery_sag", "rotor_imbalance"}
    held = np.stack([still.commands[..., 0], np.full_like(still.commands[..., 1], 0.2)], axis=-1)
    held[150:, 1] = 0.0  # what pads a trial of 1.5 s is no command
    turned = type(still)(
        **{**still.__dict__, "commands": held, "steps": still.steps - [0, len(held) - 150]}
    )
    told = {
        name
        for name, why in out_of_reach(turned).items()
        if why == "the rudder's command never changed"
    }
    assert told == {
        "rudder_lag",
        "rudder_delay",
        "rudder_backlash",
    }  # the others turn the fin by another angle


def test_a_rudder_that_stands_off_is_told_from_straight_swims():
    """Nothing was steered, and the fish circles: what it is named, not that it is out of reach."""
    straight = swim(truth(rudder_offset={"offset": 0.08}), kinds=("straight",), duration=3.0)
    straight = replace(straight, commands=straight.commands * [1.0, 0.0])
    nominal = refit.fit_base(Robot(), straight)
    gains = {
        r.name: r.gain
        for r in screening.rank(
            nominal, ("rudder_offset", "camera_scale"), straight, lambda _: None
        )
    }
    assert "rudder_offset" not in out_of_reach(straight)
    assert gains["rudder_offset"] > gains["camera_scale"] + 100.0


def test_names_that_cannot_be_judged_are_no_candidates_and_without_one_the_reasons_are_said():
    still = swim(Robot(), kinds=("straight",), duration=1.0)
    with pytest.raises(
        NoCandidateError, match=r"could be judged \(rudder_lag: the rudder never moved\)"
    ):
        pipeline.diagnose(still, Robot(), names=["rudder_lag"])
    given = Robot().with_effect("current", x=0.03)
    with pytest.raises(NoCandidateError, match="current: the given robot has it"):
        pipeline.diagnose(still, given, names=["current"])
    assert known(["current", "tether", "current"]) == ("current", "tether")


def test_an_effect_of_the_user_competes_with_the_others(monkeypatch):
    monkeypatch.setitem(EFFECTS, "mine", EFFECTS["quadratic_drag"])
    assert "mine" in candidates()
    assert kind_of("mine") == "physics"


def test_a_sensor_error_competes_once_the_filter_knows_it(monkeypatch):
    monkeypatch.setitem(SENSOR_EFFECTS, "mine", SENSOR_EFFECTS["camera_scale"])
    assert "mine" not in candidates()


def test_only_known_names_compete():
    with pytest.raises(ValueError, match="unknown candidate 'magic'; known: quadratic_drag"):
        pipeline.diagnose(swim(Robot(), duration=1.0), Robot(), names=["magic"])


def test_held_out_trials_take_no_part():
    split = split_trials(swim(Robot(), kinds=("sines",) * 7, duration=1.0))
    assert set(split.held_out).isdisjoint(split.training)
    assert {*split.search, *split.check} == set(split.training)
    assert set(split.search).isdisjoint(split.check)
    assert sorted((*split.training, *split.held_out)) == list(range(7))


def test_the_search_uses_the_four_training_trials_that_are_excited_most():
    fish = swim(Robot(), kinds=("sines",) * 9, duration=1.0)
    still = fish.commands * np.isin(range(9), (0, 3, 4, 7, 8))[:, None]  # 2, 5 and 8 are held out
    split = split_trials(replace(fish, commands=still))
    assert split.held_out == (2, 5, 8)
    assert split.search == (0, 3, 4, 7)
    assert split.check == (1, 6)


def test_the_held_out_trials_have_no_say_in_what_is_searched():
    """One of them steers far: measured against it a fast straight swim would excite more than a slow steered one."""
    fish = swim(Robot(), kinds=("sines",) * 9, duration=2.0)
    swing = np.sin(0.2 * np.arange(fish.length))[:, None]
    rotor = np.where(np.arange(9) == 6, 25.0, np.where(np.arange(9) == 7, 0.0, 100.0)) * swing
    rudder = np.where(np.isin(np.arange(9), (4, 7)), 0.0, 0.3) * swing
    calm = replace(fish, commands=np.stack([rotor, rudder], axis=-1))
    far = calm.commands.copy()
    far[:, 2, 1] = 0.78 * np.sign(swing[:, 0])
    assert (
        split_trials(calm).search
        == split_trials(replace(calm, commands=far)).search
        == (0, 1, 3, 6)
    )


def test_what_is_out_of_reach_is_told_by_the_training_trials():
    """Of three trials the third is held out: that the rudder moved there tells nobody how it moves."""
    fish = swim(Robot(), kinds=("straight",) * 2 + ("sines",), duration=1.0)
    with pytest.raises(NoCandidateError, match="rudder_lag: the rudder never moved"):
        pipeline.diagnose(fish, Robot(), names=["rudder_lag"])


def test_what_pads_a_shorter_trial_does_not_excite():
    """A steady circle of half the length is no step of the rudder."""
    fish = swim(Robot(), kinds=("sines",) * 6, duration=2.0)
    commands = np.stack([np.sin(0.2 * np.arange(fish.length)), np.zeros(fish.length)], axis=-1)
    commands = np.repeat(commands[:, None], 6, axis=1)
    commands[..., 1] = 0.3 * np.sin(0.1 * np.arange(fish.length))[:, None]
    commands[:, 3] = [1.0, 0.4]
    commands[100:, 3] = 0.0
    strength = excitation(
        replace(fish, commands=commands, steps=np.where(np.arange(6) == 3, 100, fish.steps))
    )
    assert strength[3] == pytest.approx(0.0, abs=1e-9)
    assert strength[0] > 1.0


def test_a_search_sees_the_training_trials_and_knows_which_of_them_it_has_not_fitted():
    fish = swim(Robot(), kinds=("sines",) * 9, duration=1.0)
    split = split_trials(fish)
    trials = trials_of(fish, split)
    assert [trials.training.names[i] for i in trials.check] == [fish.names[i] for i in split.check]
    assert {*trials.searched.names}.isdisjoint(trials.training.names[i] for i in trials.check)


def test_the_level_is_checked_and_probabilities_add_up():
    with pytest.raises(ValueError, match=r"false_alarms: got 0.9"):
        Level(0.9)
    assert Level(0.001).enough(100, 1, 30) > Level(0.1).enough(100, 1, 30)
    odds = probabilities({"a": -100.0, "b": -110.0, "c": -500.0})
    assert Level(0.02).enough(0, 2, 30) == pytest.approx(
        4.0 * np.log(30 / 0.02)
    )  # chi square of two is exponential
    assert Level().enough(1e6, 1, 30) == 1000.0  # a thousandth of a nat per measurement
    assert sum(odds.values()) == pytest.approx(1.0)
    assert odds["a"] > odds["b"] > odds["c"]


def test_a_name_that_was_found_as_well_is_no_rival(monkeypatch):
    monkeypatch.setattr(backward_elimination, "evidence", lambda fit, _: fit)
    contest = {"current": 10.0, "tip_slip": 40.0, "wall_effect": 9.0}
    first, second = Accepted("current", None, contest), Accepted("tip_slip", None, contest)
    odds = answers.competition(first, [first, second])
    assert list(odds) == ["current", "wall_effect"]
    assert odds["current"] == pytest.approx(1.0 / (1.0 + np.exp(-1.0)))
    assert list(answers.competition(second, [first, second])) == ["tip_slip", "wall_effect"]


def test_the_next_experiment_follows_what_is_open():
    assert "nothing was found missing" in next_experiment([], [])["why"]
    turning = next_experiment([], [], grows_with="yaw_rate")
    assert "unexplained" in turning["why"]
    assert {row["rudder"] for row in turning["program"]} == {0.5, -0.5}
    rivals = next_experiment(["rudder_lag"], ["rudder_delay"])
    assert rivals["why"].startswith("tell rudder_lag from rudder_delay")
    told_apart = next_experiment(
        ["current"], ["quadratic_drag"]
    )  # by what the rival shows best in: coasting
    assert 0.0 in {row["amplitude"] for row in told_apart["program"]}


def test_a_gyro_that_reads_too_much_shows_in_circles():
    """Where the fish goes straight there is nothing to read: the factor's standard error is six times that of circles."""
    turns = {row["rudder"] for row in next_experiment(["gyro_scale"], [])["program"]}
    assert turns == {0.5, -0.5}


@pytest.mark.parametrize(
    ("names", "much", "share", "verdict", "named"),
    [
        (("current", "rudder_lag"), False, 0.9, "missing_physics", 2),
        (("rudder_lag", "gyro_scale"), False, 0.0, "sensor_or_actuator", 2),
        (("current",), True, 0.4, "missing_physics", 1),
        (("current",), True, 0.6, "unexplained", 0),
        ((), True, 0.0, "unexplained", 0),
        ((), False, 1.0, "no_mismatch", 0),
    ],
)
def test_names_stand_unless_they_leave_more_than_they_explain(
    monkeypatch, names, much, share, verdict, named
):
    monkeypatch.setattr(verdicts, "much_is_left", lambda _: much)
    monkeypatch.setattr(verdicts, "unexplained_share", lambda _: share)
    found = SimpleNamespace(accepted=tuple(SimpleNamespace(name=name) for name in names))
    assert verdicts.verdict(found) == verdict
    assert len(verdicts.named(found)) == named


@pytest.mark.parametrize(
    ("held", "of", "told"), [((1, 2), "held_out", True), ((), "training", False)]
)
def test_what_the_errors_are_of_is_said_and_an_interval_only_of_trials_held_out(
    monkeypatch, held, of, told
):
    """Of two trials none is held out: what is shown then is how well they were fitted, which is no improvement."""
    monkeypatch.setattr(answers, "held_out_errors", lambda *_: {})
    monkeypatch.setattr(answers, "whiteness", lambda _: {})
    fit = SimpleNamespace(robot=Robot(), noise=Noise())
    density = {
        "nominal": np.zeros(2),
        "refitted": np.zeros(2),
        "with_effects": np.array([0.3, 0.4]),
    }
    names = SimpleNamespace(names=("a", "b", "c"))
    split = SimpleNamespace(held_out=held)
    found = SimpleNamespace(
        robot=Robot(),
        given_noise=Noise(),
        nominal=fit,
        final=fit,
        outlook=None,
        held_out=density,
        split=split,
        experiment=names,
    )
    entry = answers.fit_entry(found)
    assert entry["errors_are_of"] == of
    assert len(entry["held_out_trials"]) == len(held)
    assert bool(np.isfinite(entry["improvement_ci95"]).all()) is told


def test_effects_share_out_their_gains_and_name_plausible_rivals_only(monkeypatch):
    def accepted(name, gain):
        return Accepted(name, SimpleNamespace(gain=lambda _: gain, ranking=range(30)), {})

    monkeypatch.setattr(answers, "where_entry", lambda *_: {})
    monkeypatch.setattr(answers, "effect_parameters", lambda *_: {})
    monkeypatch.setattr(
        answers, "competition", lambda a, _: {a.name: 0.9, "tether": 0.085, "payload": 0.015}
    )
    found = SimpleNamespace(
        accepted=(accepted("current", 300.0), accepted("tip_slip", 100.0)), final=None
    )
    first, second = (answers.effect_entry(found, a) for a in found.accepted)
    assert (first["share"], second["share"]) == (0.75, 0.25)
    assert first["rivals"] == [{"name": "tether", "probability": 0.085}]
    assert first["evidence"]["log_likelihood_gain"] == 300.0
    assert first["kind"] == "physics"


@pytest.mark.parametrize(
    ("foretold", "p_value"), [(None, 0.0872), (38.0, 30 * np.exp(-38.0 / 4.0))]
)
def test_an_effect_that_stands_on_trials_left_out_in_turn_is_as_sure_as_these_say(
    monkeypatch, foretold, p_value
):
    for part in ("where_entry", "effect_parameters"):
        monkeypatch.setattr(answers, part, lambda *_: {})
    monkeypatch.setattr(answers, "competition", lambda a, _: {a.name: 1.0})
    weak = Accepted(
        "wave_drag", SimpleNamespace(gain=lambda _: 28.0, ranking=range(30)), {}, foretold
    )
    entry = answers.effect_entry(SimpleNamespace(accepted=(weak,), final=None), weak)
    assert entry["evidence"]["p_value"] == pytest.approx(p_value, rel=0.01)


def test_of_two_effects_each_has_its_own_place():
    experiment = swim(
        truth(hull_asymmetry={"sway": 0.0, "yaw": 0.2}, tether={"stiffness": 0.6, "length": 0.0})
    )
    robot = truth(
        hull_asymmetry={"sway": 0.0, "yaw": 0.2}, tether={"stiffness": 0.6, "length": 0.0}
    )
    experiment = swim(robot)
    final = settle(
        evaluate(nominal_hypothesis(robot, ()), np.zeros(0), experiment, Noise()), experiment
    )
    accepted = [SimpleNamespace(name="hull_asymmetry"), SimpleNamespace(name="tether")]
    parts = pipeline.shares(final, accepted, experiment)
    yaw = {name: dof_shares(less, final)["yaw"] for name, (less, _) in parts.items()}
    assert yaw["hull_asymmetry"] > 0.5
    assert yaw["tether"] < 0.2
    assert set(parts["tether"][0].hypothesis.names) == {"hull_asymmetry"}
    assert (
        pipeline.shares(final, accepted[:1], experiment) == {}
    )  # one effect: what the refitted nominal model lacks
