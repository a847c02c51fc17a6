# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Recipes, curriculum and runs on disk.

The shipped YAML is the default, and what cannot work is refused by name. A run resumes exactly, a diverging one rolls back, the
controller reads the weights.
"""

import json
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from fish_control.control_law import ControlLimits, Gains
from fish_control.gains_file import read_gains_file, write_gains_file
from fish_control.line_of_sight import GuidanceConfig
from fish_control.path_batch import TrackerConfig
from fish_control.policy import Policy
from fish_control.policy_spec import INPUTS, PolicySpec
from fish_report.errors import UserError
from fish_sim.methods import METHODS
from fish_sim.robot import Robot
from fish_sim.scheme import growth, modes_at_rest
from fish_train.evaluation.candidates import read_candidate
from fish_train.training import parallel_runs
from fish_train.training.batch import WindowResult
from fish_train.training.closed_loop_equations import Law
from fish_train.training.config import TrainConfig, load_config, make_config
from fish_train.training.curriculum import CERTAIN, SlidingCriterion, make_levels
from fish_train.training.network import (
    FORMS,
    from_tensors,
    split,
    to_tensors,
    weight_count,
)
from fish_train.training.run import (
    CHECKPOINT,
    Job,
    Status,
    run,
)
from fish_train.training.run_files import SCHEDULE, load_checkpoint, save_checkpoint, write_weights
from fish_train.training.run_log import RunLog, read_curve
from fish_train.training.search import search
from fish_train.training.trainer import Trainer, TrainingDiverged, training_scheme
from fish_train.verbs.train import parse_settings

RECIPE = Path(__file__).parents[1] / "config" / "train.yaml"
SHORT = {
    "batch": 3,
    "unroll": 4,
    "hold": 5,
    "episode": 1.2,
    "approach": 0.4,
    "amplitudes": [1.0],
    "cycles": [0.5],
    "radii": [1.5],
    "thresholds": [0.4],
    "criterion_episodes": 2,
    "polish_updates": 6,
    "noise_position": 0.002,
    "latency": 0.05,
    "randomise": 0.2,
}


def test_the_shipped_recipe_is_the_default() -> None:
    content = load_config(RECIPE)
    assert list(content) == list(TrainConfig().to_plain())
    assert make_config(content) == TrainConfig()


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"batch": 0}, "batch: got 0"),
        ({"unroll": 2.5}, "unroll: got 2.5; expected a whole number"),
        ({"slowest": 0.3, "fastest": 0.1}, "slowest: got 0.3 m/s; expected at most fastest"),
        ({"fastest": 0.9}, "fastest: got 0.9"),
        ({"radii": [1.0, 0.01]}, "radii: got 0.01"),
        ({"radii": []}, "radii: got ()"),
        ({"thresholds": [0.01, 0.03]}, "thresholds: got .* falling"),
        ({"sinusoid_length": 3.0}, "turns within 0.06 m; expected at least 0.15 m"),
        ({"approach": 20.0}, "approach: got 20.0 s; expected less than an episode"),
        ({"latency": 2.0}, "latency: got 2.0"),
        ({"learning_rate": float("nan")}, "learning_rate: got nan"),
        ({"start_speed_ki": 0.5}, "start_speed_ki: got 0.5"),
        ({"lerning_rate": 1e-3}, "unknown name 'lerning_rate'; known: batch"),
    ],
)
def test_what_cannot_work_is_refused_by_name(values: dict, said: str) -> None:
    with pytest.raises(UserError, match=said.replace("(", r"\(").replace(")", r"\)")):
        make_config(values)


def test_settings_of_the_command_line() -> None:
    assert parse_settings(["batch=4", "learning_rate=3e-4", "radii=[1.0, 0.8]"]) == {
        "batch": 4,
        "learning_rate": 3e-4,
        "radii": [1.0, 0.8],
    }
    with pytest.raises(UserError, match="--set batch: expected KEY=VALUE"):
        parse_settings(["batch"])
    with pytest.raises(UserError, match="expected a number"):
        parse_settings(["batch=many"])


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"batch: 2020-13-45", "cannot be read as YAML: month must be in 1..12"),
        (b"batch: [1", "cannot be read as YAML: while parsing"),
        (b"name: \xff", "cannot be read as YAML: 'utf-8' codec"),
        (b"[batch]", "got list; expected a table of name: value"),
    ],
)
def test_a_recipe_that_is_no_table_is_refused_with_its_name(
    content: bytes, said: str, tmp_path: Path
) -> None:
    (tmp_path / "recipe.yaml").write_bytes(content)
    with pytest.raises(UserError, match=f"recipe.yaml: {said}"):
        load_config(tmp_path / "recipe.yaml")


def test_an_empty_recipe_is_the_default(tmp_path: Path) -> None:
    (tmp_path / "recipe.yaml").write_text("# all as shipped\n")
    assert make_config(load_config(tmp_path / "recipe.yaml")) == TrainConfig()


def test_sinusoids_and_circles_alternate_once_for_each_threshold() -> None:
    levels = make_levels(make_config({}))
    assert len(levels) == 24
    assert [level.family for level in levels[:4]] == ["sinusoid", "circle", "sinusoid", "circle"]
    assert [level.threshold for level in levels] == [0.03] * 12 + [0.01] * 12
    assert [level.size for level in levels[1:12:2]] == [1.5, 1.4, 1.3, 1.2, 1.1, 1.0]
    assert [(level.size, level.cycles) for level in levels[0:12:2]] == [
        (1.0, 0.5),
        (1.0, 1.0),
        (1.0, 2.0),
        (1.5, 0.5),
        (1.5, 1.0),
        (1.5, 2.0),
    ]


def test_paths_of_a_level_have_its_size() -> None:
    config = make_config({})
    levels, rng = make_levels(config), np.random.default_rng(1)
    waves = levels[4].paths(config, rng)
    assert len({round(float(path.heading_at(0.0)), 3) for path in waves}) > 4  # phases differ
    for path in waves:
        assert np.abs(path.points[:, 1]).max() == pytest.approx(levels[4].size, rel=1e-3)
    left, right = levels[1].paths(config, rng)
    assert np.median(left.curvature) == pytest.approx(1.0 / 1.5, rel=1e-3)
    assert np.median(right.curvature) == pytest.approx(-1.0 / 1.5, rel=1e-3)


def test_a_level_passes_on_a_full_window_below_its_threshold() -> None:
    criterion = SlidingCriterion(3)
    for value in (0.02, 0.02):
        criterion.add(value)
        assert not criterion.passed(0.03)  # the window is not full
    criterion.add(0.08)
    assert criterion.mean == pytest.approx(0.04)
    assert not criterion.passed(0.03)
    criterion.add(0.02)
    criterion.add(0.02)
    criterion.add(0.02)  # the bad episode has left the window
    assert criterion.passed(0.03)


def short(**values) -> TrainConfig:
    return make_config({**SHORT, **values})


def job(folder: Path, **values) -> Job:
    return Job(folder, short(), Robot(), 3, "robofish train", **values)


def episodes(trainer: Trainer, count: int) -> list:
    rows = []
    while len(rows) < count:
        if (progress := trainer.step()) is not None:
            rows.append(progress)
    return rows


@pytest.mark.parametrize("links", range(1, 13))
def test_the_steps_of_training_are_stable_for_every_tail(links: int) -> None:
    """Also where it is a fifth stiffer than the nominal one: training draws its fish."""
    robot = Robot(links=links)
    stiffer = Robot(links, {"tail_stiffness": 1.2 * robot.parameters["tail_stiffness"]})
    scheme = training_scheme(robot)
    for tail in (robot, stiffer):
        modes = modes_at_rest(tail.structure, np.array(tail.vector()))
        assert growth(METHODS[scheme.method], modes, scheme.substeps) < 1.0 + 1e-6


def test_a_restored_run_continues_exactly(tmp_path: Path) -> None:
    first = Trainer(short(), Robot(), 3)
    episodes(first, 2)
    save_checkpoint(tmp_path / CHECKPOINT, first)
    expected = episodes(first, 3)
    second = Trainer(short(), Robot(), 3)
    load_checkpoint(tmp_path / CHECKPOINT, second)
    assert episodes(second, 3) == expected
    assert np.array_equal(second.weights, first.weights)


def test_a_checkpoint_of_another_recipe_is_refused(tmp_path: Path) -> None:
    save_checkpoint(tmp_path / CHECKPOINT, Trainer(short(), Robot(), 3))
    with pytest.raises(UserError, match=r"learning_rate was 0.001, is 0.01"):
        load_checkpoint(tmp_path / CHECKPOINT, Trainer(short(learning_rate=0.01), Robot(), 3))
    with pytest.raises(UserError, match="format, robot and seed"):
        load_checkpoint(tmp_path / CHECKPOINT, Trainer(short(), Robot(), 4))
    with pytest.raises(UserError, match="form was 'network', is 'constant'"):
        load_checkpoint(tmp_path / CHECKPOINT, Trainer(short(), Robot(), 3, form=FORMS["constant"]))
    (tmp_path / CHECKPOINT).write_bytes(b"PK\x03\x04 cut short")
    with pytest.raises(UserError, match="not a checkpoint of training"):
        load_checkpoint(tmp_path / CHECKPOINT, Trainer(short(), Robot(), 3))


# of another robot
LAW = Law(
    limits=ControlLimits(curvature_gain=0.3, throttle_quadratic=9.0),
    guidance=GuidanceConfig(slip_arm=0.1),
    tracker=TrackerConfig(lookahead=0.5),
)


def constant(law: Law | None = None) -> Trainer:
    return Trainer(short(), Robot(), 3, law, form=FORMS["constant"])


@pytest.fixture
def nothing_compiled(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where nothing swims, building the loop of another law or robot would only take time."""
    monkeypatch.setenv("FISH_SIM_NO_COMPILER", "1")


def test_a_checkpoint_of_another_law_is_refused(tmp_path: Path, nothing_compiled: None) -> None:
    file = tmp_path / CHECKPOINT
    save_checkpoint(file, constant(LAW))
    with pytest.raises(
        UserError, match=r"limits.curvature_gain was 0.3, is 0.21.* give --robot as it was"
    ):
        load_checkpoint(file, constant())
    measured_again = replace(LAW, limits=replace(LAW.limits, curvature_gain=0.3 * (1.0 + 1e-12)))
    load_checkpoint(file, constant(measured_again))


def test_a_checkpoint_of_old_which_did_not_note_its_law_has_the_nominal_one(
    tmp_path: Path, nothing_compiled: None
) -> None:
    file = tmp_path / CHECKPOINT
    save_checkpoint(file, constant())
    with np.load(file) as content:
        arrays = dict(content)
    plain = json.loads(str(arrays.pop("plain")))
    del plain["law"]
    np.savez(file, plain=np.array(json.dumps(plain)), **arrays)
    load_checkpoint(file, constant())
    with pytest.raises(
        UserError, match=r"made before checkpoints noted the law's feed-forward.* start anew"
    ):
        load_checkpoint(file, constant(LAW))


def test_a_checkpoint_may_be_read_by_whom_the_user_lets(tmp_path: Path) -> None:
    trainer, before = Trainer(short(), Robot(), 3, form=FORMS["constant"]), os.umask(0o027)
    try:
        save_checkpoint(tmp_path / CHECKPOINT, trainer)
    finally:
        os.umask(before)
    assert (tmp_path / CHECKPOINT).stat().st_mode & 0o777 == 0o640
    assert [file.name for file in tmp_path.iterdir()] == [CHECKPOINT]


def test_a_warm_start_from_other_scales_is_refused(tmp_path: Path) -> None:
    contract = PolicySpec(inputs=tuple(replace(i, scale=2.0 * i.scale) for i in INPUTS))
    file = tmp_path / "w.safetensors"
    write_gains_file(file, Policy(contract, to_tensors(Trainer(short(), Robot(), 3).weights)))
    with pytest.raises(UserError, match="other scales"):
        run(job(tmp_path / "run", warm_start=file), lambda _: None)


@pytest.mark.parametrize(
    ("start", "said"),
    [
        ("nowhere.safetensors", "nowhere.safetensors: cannot be read"),
        ("run/gains.safetensors", "--overwrite deletes; copy it"),
    ],
)
def test_a_run_is_not_overwritten_by_one_that_cannot_start(
    start: str, said: str, tmp_path: Path
) -> None:
    folder = tmp_path / "run"
    folder.mkdir()
    (folder / CHECKPOINT).write_bytes(b"days of work")
    write_gains_file(
        folder / "gains.safetensors", Policy(PolicySpec(), to_tensors(np.zeros(weight_count())))
    )
    with pytest.raises(UserError, match=said):
        run(job(folder, overwrite=True, warm_start=tmp_path / start), lambda _: None)
    assert (folder / CHECKPOINT).read_bytes() == b"days of work"
    assert (folder / "gains.safetensors").exists()


def test_a_robot_that_cannot_be_trained_leaves_the_run_that_was_to_be_overwritten(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object) -> Trainer:
        raise UserError("not this robot")

    (tmp_path / CHECKPOINT).write_bytes(b"days of work")
    monkeypatch.setattr("fish_train.training.run.Trainer", refuse)
    with pytest.raises(UserError, match="not this robot"):
        run(job(tmp_path, overwrite=True), lambda _: None)
    assert (tmp_path / CHECKPOINT).read_bytes() == b"days of work"


def test_of_several_seeds_none_begins_where_one_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "2").mkdir()
    (tmp_path / "2" / CHECKPOINT).write_bytes(b"days of work")
    monkeypatch.setattr(
        parallel_runs, "worker_pool", lambda *_: pytest.fail("workers were started")
    )
    with pytest.raises(UserError, match="2: holds a training run; continue it with --resume"):
        parallel_runs.run_all([job(tmp_path / name) for name in "12"], 2, lambda _: None)
    assert not (tmp_path / "1").exists()


def test_a_run_finishes_and_its_weights_are_those_of_torch(tmp_path: Path) -> None:
    statuses: list[Status] = []
    last = run(job(tmp_path / "run"), statuses.append)
    assert last.state == "finished"
    assert last.progress.level == 2
    assert [row.level for row in read_curve(tmp_path / "run")][-1] == 2
    policy = read_gains_file(tmp_path / "run" / "gains.safetensors")
    assert policy.contract.training_seed == 3
    assert policy.contract.robot_hash == Robot().digest()
    rng = np.random.default_rng(1)
    x = torch.from_numpy(rng.standard_normal((20, 6)))
    h = x
    layers = split(from_tensors(policy.tensors))
    for k, (W, b) in enumerate(layers):
        h = h @ torch.from_numpy(W).T + torch.from_numpy(b)
        h = torch.tanh(h) if k == len(layers) - 1 else torch.relu(h)
    low = torch.tensor([o.low for o in policy.contract.outputs])
    span = torch.tensor([o.high - o.low for o in policy.contract.outputs])
    expected = low + span * 0.5 * (h + 1.0)
    assert np.allclose(np.stack(policy.gains(x.numpy()), axis=-1), expected.numpy(), atol=1e-6)
    assert "seed 3; training finished" in (tmp_path / "run" / "model_card.md").read_text()
    again = Trainer(short(), Robot(), 3, weights=from_tensors(policy.tensors))
    assert np.array_equal(again.weights, from_tensors(policy.tensors))


def test_a_run_stopped_and_resumed_ends_like_one_in_one_go(tmp_path: Path) -> None:
    run(job(tmp_path / "whole"), lambda _: None)
    stopped = replace(job(tmp_path / "parts"), max_seconds=0.0)
    assert run(stopped, lambda _: None).state == "stopped"
    with pytest.raises(UserError, match="--resume"):
        run(job(tmp_path / "parts"), lambda _: None)
    assert run(job(tmp_path / "parts", resume=True), lambda _: None).state == "finished"
    whole, parts = (
        read_gains_file(tmp_path / k / "gains.safetensors").tensors for k in ("whole", "parts")
    )
    assert all(np.array_equal(whole[name], parts[name]) for name in whole)


def test_a_run_out_of_updates_says_which_level_it_did_not_pass(tmp_path: Path) -> None:
    hard = job(tmp_path)
    hard = replace(hard, config=replace(hard.config, thresholds=(1e-4,), max_updates=20))
    last = run(hard, lambda _: None)
    assert last.state == "stopped"
    assert last.progress.level == 0
    assert "(sinusoid 1 m x 0.5, 0.0001 m)" in last.message
    assert "expected below 0.0001 m" in last.message
    assert "stopped at max_updates 20 before" in last.message
    assert "max_updates can be raised" in last.message


@pytest.mark.parametrize(("updates", "seconds"), [(4, float("inf")), (1000, 0.0)])
def test_a_run_at_its_limit_goes_on_only_when_it_is_raised(
    updates: int, seconds: float, tmp_path: Path
) -> None:
    whole = job(tmp_path / "whole", form="constant")
    run(whole, lambda _: None)
    parts = replace(whole, folder=tmp_path / "parts", resume=True)
    limited = replace(parts, config=replace(parts.config, max_updates=updates), max_seconds=seconds)
    assert run(limited, lambda _: None).state == "stopped"
    curve, file = read_curve(parts.folder), parts.folder / "gains.safetensors"
    made = file.stat().st_mtime_ns
    again = run(limited, lambda _: None)
    assert again.state == "stopped"
    assert "before the level was passed" in again.message
    assert read_curve(parts.folder) == curve
    assert file.stat().st_mtime_ns == made
    assert run(parts, lambda _: None).state == "finished"
    found, expected = (
        read_gains_file(k.folder / "gains.safetensors").tensors for k in (parts, whole)
    )
    assert np.array_equal(found["gains"], expected["gains"])


def test_a_finished_run_resumed_keeps_its_card(tmp_path: Path) -> None:
    run(job(tmp_path, form="constant"), lambda _: None)
    card = (tmp_path / "model_card.md").read_text()
    assert "last training episode" in card
    assert run(job(tmp_path, form="constant", resume=True), lambda _: None).state == "finished"
    assert (tmp_path / "model_card.md").read_text() == card
    (tmp_path / "model_card.md").write_text("of an earlier stop")
    run(job(tmp_path, form="constant", resume=True), lambda _: None)
    assert "training finished" in (tmp_path / "model_card.md").read_text()


def test_a_finished_run_resumed_keeps_its_weights_and_what_they_say(tmp_path: Path) -> None:
    run(job(tmp_path, form="constant"), lambda _: None)
    again = replace(job(tmp_path, form="constant", resume=True), command="robofish paper")
    run(again, lambda _: None)
    file = tmp_path / "gains.safetensors"
    assert read_gains_file(file).contract.note == "trained by: robofish train"
    write_gains_file(file, Policy.constant(Gains(*[0.05] * 6)))  # of an earlier stop
    run(again, lambda _: None)
    assert read_gains_file(file).contract.note == "trained by: robofish paper"


def test_a_schedule_is_swum_on_the_law_it_was_trained_with(
    tmp_path: Path, nothing_compiled: None
) -> None:
    trainer = Trainer(short(), Robot(), 3, LAW, form=FORMS["schedule"])
    write_weights(tmp_path, trainer, "robofish train")
    file = tmp_path / SCHEDULE
    found = read_candidate(str(file))
    assert found.law == LAW
    assert np.array_equal(found.gains.weights, trainer.weights)
    content = json.loads(file.read_text())
    file.write_text(
        json.dumps({"form": "schedule", "weights": content["weights"]})
    )  # as it was of old
    assert read_candidate(str(file)).law == Law()
    for broken, said in (
        ({**content, "limits": {}}, "limits lacks amplitude_rate"),
        ({k: v for k, v in content.items() if k != "guidance"}, "'guidance'"),
        ({**content, "lookahead": 5.0}, "lookahead is 5.0 m"),
    ):
        file.write_text(json.dumps(broken))
        with pytest.raises(UserError, match=said):
            read_candidate(str(file))


def test_robots_differ_in_what_is_uncertain_of_them_and_not_in_their_effects(
    nothing_compiled: None,
) -> None:
    robot = (
        Robot()
        .with_effect("rudder_placement", tip_share=0.9)
        .with_effect("current", x=0.03, y=-0.02)
    )
    trainer = Trainer(short(batch=50), robot, 3)
    own = dict(zip(trainer._stepper.layout.parameters, robot.vector(), strict=True))
    drawn = dict(zip(own, trainer.batch_state.parameters.T, strict=True))
    for name, values in drawn.items():
        if name in CERTAIN or "." in name:
            assert (values == own[name]).all(), name
        else:
            share = values / own[name]
            assert 0.8 <= share.min() < 0.9 and 1.1 < share.max() <= 1.2, name
    assert {"rudder_placement.tip_share", "current.y", "head_inertia", "rotor_inertia"} < set(drawn)


def test_what_was_logged_after_the_checkpoint_is_forgotten(tmp_path: Path) -> None:
    progress = episodes(Trainer(short(), Robot(), 3), 3)
    with RunLog(tmp_path, 0) as log:
        for row in progress:
            log.add(1.0, row)
    with RunLog(tmp_path, progress[1].update) as log:
        assert [row.update for row in read_curve(tmp_path)] == [p.update for p in progress[:2]]
        assert log.seconds == 1.0
    with (tmp_path / "curve.csv").open("a") as stream:
        stream.write("2.0,99,7")  # a kill in the middle of a line
    assert len(read_curve(tmp_path)) == 2


def test_diverging_training_is_said_and_rolled_back(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    good = Trainer(short(), Robot(), 3)
    calls = 0
    honest = type(good._loop).window

    def window(self, *args, **kwargs) -> WindowResult:
        nonlocal calls
        calls += 1
        result = honest(self, *args, **kwargs)
        return replace(result, cost=float("nan")) if calls == 7 else result

    monkeypatch.setattr(type(good._loop), "window", window)
    statuses: list[Status] = []
    last = run(job(tmp_path / "run"), statuses.append)
    assert last.state == "diverged"
    assert "rolled back to update 0" in last.message
    assert "smaller learning_rate" in last.message
    weights = from_tensors(read_gains_file(tmp_path / "run" / "gains.safetensors").tensors)
    assert np.array_equal(weights, good.weights)
    assert any(status.progress is not None for status in statuses)  # of updates that are no more
    assert last.progress is None
    assert read_curve(tmp_path / "run") == []
    card = (tmp_path / "run" / "model_card.md").read_text()
    assert "training diverged, rolled back to level 0 of 2 after 0 updates" in card
    assert "last training episode" not in card
    assert "stopped" not in card


def test_a_diverged_run_tells_of_the_checkpoint_whose_weights_it_hands_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Diverges in its fourth episode, the checkpoint from before the third."""
    calls, honest = 0, Trainer.step

    def step(self):
        nonlocal calls
        calls += 1
        # one episode is three updates of 0.4 s
        monkeypatch.setattr(
            "fish_train.training.run.CHECKPOINT_PERIOD", 0.0 if calls <= 6 else np.inf
        )
        if calls == 11:
            raise TrainingDiverged("cost nan")
        return honest(self)

    hard = job(tmp_path, form="constant")
    hard = replace(hard, config=replace(hard.config, thresholds=(1e-4,)))
    monkeypatch.setattr(Trainer, "step", step)
    statuses: list[Status] = []
    last = run(hard, statuses.append)
    told = [status.progress.update for status in statuses[:-1]]
    assert last.state == "diverged"
    assert told == [3, 6, 9]
    assert last.progress.update == 6
    assert "rolled back to update 6" in last.message
    curve = read_curve(tmp_path)
    assert [row.update for row in curve] == [3, 6]
    assert f"({last.progress.name}): mean |cross-track| {curve[-1].cross_track:.4f} m" in (
        card := (tmp_path / "model_card.md").read_text()
    )
    assert "training diverged, rolled back to level 0 of 2 after 6 updates" in card


@pytest.fixture
def short_search(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("fish_train.training.search.GENERATIONS", {6: 2})
    monkeypatch.setattr("fish_train.training.search.POPULATION", 2)
    monkeypatch.setattr("fish_train.training.search.EPISODES", 1)


def test_a_search_says_so_on_its_card(tmp_path: Path, short_search: None) -> None:
    assert run(job(tmp_path, form="constant", search=True), lambda _: None).state == "finished"
    assert read_gains_file(tmp_path / "gains.safetensors").contract.layers == ()
    card = (tmp_path / "model_card.md").read_text()
    assert "found by differential evolution" in card
    assert "training stopped" not in card


def test_search_does_not_lose_against_its_start(short_search: None) -> None:
    said: list[str] = []
    trainer = constant()
    bank = trainer.ladder_bank()
    found, weights = search(trainer, said.append)
    again = constant()
    batch_state, noise = again.draw_batch(again.ladder_bank()), again.draw_noise()
    assert again.rollout_cost(weights, batch_state.copy(), bank, noise) == pytest.approx(found)
    assert found <= again.rollout_cost(again.weights, batch_state.copy(), bank, noise)
    assert again.rollout_cost(weights, batch_state.copy(), bank) != pytest.approx(
        found
    )  # what is seen has errors
    assert said
    assert "generation 1" in said[0]


def test_a_search_may_start_with_gains_at_the_ends_of_their_ranges(short_search: None) -> None:
    config = short(start_speed_kd=0.0, start_steering_kp=1.0)
    found, weights = search(Trainer(config, Robot(), 3, form=FORMS["constant"]), lambda _: None)
    assert np.isfinite(found)
    assert np.abs(weights).max() <= 3.0
