"""After the labels are open: the oracle on every world, and what of an answer only the truth can judge."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from fish_report.json_file import number, write_json
from fish_report.page import Table
from fish_study.build import make_readings
from fish_study.competitors import compete
from fish_study.localisation import (
    dof_overlap,
    overlap,
    stated_range,
    stated_times,
    true_push,
)
from fish_study.oracle import (
    Sight,
    as_experiment,
    detects,
    look,
)
from fish_study.out_of_vocabulary import OUTSIDE
from fish_study.runner import spread
from fish_study.scenario import NoWorld, World
from fish_study.score import Score, vocabulary
from fish_study.study import Study, StudyError, read_json
from fish_study.tables import Share
from fish_study.tool_version import the_tool, tool_digest
from fish_sysid.dataset.experiment import Experiment
from fish_sysid.diagnosis.effect_wrench import acting, f1
from fish_sysid.diagnosis.latent_force import dof_shares
from fish_sysid.diagnosis.trial_split import split_trials
from fish_sysid.diagnosis.vocabulary import candidates
from fish_sysid.estimation.ekf_types import Noise

HORIZON = 1  # index of 2 s among the oracle's horizons
# of other worlds no structure that the oracle could fit is the true one
JUDGED = "the simulator's fish with three tail links, no vortex among them"


@dataclass(frozen=True)
class Task:
    """One world to be judged."""

    name: str
    world: World
    place: Path
    diagnosis: Mapping[str, Any] | None  # None: the tool gave no answer
    version: str = ""  # of the tool that the study examines; "": any

    @property
    def file(self) -> Path:
        """The judgement."""
        return self.place / "judged.json"


def judge_world(task: Task) -> str:
    """Write judged.json; returns the world's name."""
    if not task.file.exists():
        version = the_tool(task.version, f"{task.name}, to be judged")
        write_json(task.file, {**judge(task.world, task.diagnosis), "tool": version})
    return task.name


def judge(world: World, diagnosis: Mapping[str, Any] | None) -> dict[str, Any]:
    """The oracle's sight, overlap of degrees of freedom and of time, regime F1 (None where they mean nothing).

    A world without an answer is judged as well: what the oracle sees there the tool has missed.
    """
    content: dict[str, Any] = {
        "sight": None,
        "dof": None,
        "overlap": None,
        "f1": None,
        "range_f1": None,
    }
    if (
        world.plant != "fish_sim" or world.links != 3
    ):  # of those no structure of the oracle's is the true one
        return content
    try:
        experiment = as_experiment(make_readings(world), world.encoder)
    except NoWorld:
        return content
    held = _held_out(experiment) if diagnosis is None else diagnosis["fit"]["held_out_trials"]
    names = [n for n in world.names if n in vocabulary() or n in OUTSIDE]
    if not world.names:  # what an oracle that looks for something finds where nothing is
        names = [str(np.random.default_rng(world.seed).choice(candidates()))]
    answered = [] if diagnosis is None else diagnosis["effects"]
    effects = [e for e in answered if e["name"] in world.names] or answered
    if names:
        looked = look(world, experiment, held, names)
        content["sight"] = asdict(looked.sight)
        shares = dof_shares(looked.nominal, looked.true)
        content["dof"] = dof_overlap(effects[0]["where"]["dof"], shares) if effects else None
        content["rivals"] = asdict(compete(looked.nominal, looked.training, looked.held_out))
    trained = experiment.select([i for i, name in enumerate(experiment.names) if name not in held])
    push = true_push(world, trained) if effects else None
    if push is not None:
        acts, where = acting(push, np.array(Noise().wrench)), effects[0]["where"]
        said = stated_times(where["time"], trained.names, len(acts))
        content["overlap"], content["f1"] = overlap(said, acts), f1(said, acts)
        content["range_f1"] = f1(stated_range(where["covariates"], push.covariates), acts)
    return content


def _held_out(experiment: Experiment) -> list[str]:
    """As the diagnosis would have held them out."""
    return [experiment.names[i] for i in split_trials(experiment).held_out]


def judge_studies(
    studies: Sequence[Study],
    scores: Sequence[Score],
    jobs: int,
    done: Callable[[str], None],
    cluster: str = "",
) -> tuple[dict[int, bool], list[Table]]:
    """(seed -> whether the oracle detects, tables) of studies whose labels are open.

    Raises StudyError where the tool here is not the study's and a judgement is missing, or where one is of another tool.
    """
    of_study = {study: _tasks(study) for study in studies}
    tasks = [task for own in of_study.values() for task in own]
    for name in spread(judge_world, tasks, jobs, cluster):
        done(name)
    for study, own in of_study.items():
        study.check_files("judged.json", {t.name: read_json(t.file) for t in own})
    judged = {t.world.seed: read_json(t.file) for t in tasks}
    sights = {
        seed: Sight.read(content["sight"]) for seed, content in judged.items() if content["sight"]
    }
    nulls = [sights[t.world.seed] for t in tasks if not t.world.names and t.world.seed in sights]
    seen = {
        t.world.seed: detects(sights[t.world.seed], nulls)
        for t in tasks
        if t.world.names and t.world.seed in sights
    }
    rivals = {seed: content["rivals"] for seed, content in judged.items() if content.get("rivals")}
    return seen, [judged_table(scores, judged, sights, seen), rivals_table(scores, rivals)]


def _tasks(study: Study) -> list[Task]:
    """One for each world, judged already or not. Raises StudyError where one is not, and the tool here is not the study's."""
    results, version = study.results, study.about.get("tool", "")
    tasks = [
        Task(name, world, study.place(name).resolve(), results[name]["diagnosis"], version)
        for name, world in study.worlds.items()
    ]
    missing = sum(not task.file.exists() for task in tasks)
    if missing and (digest := tool_digest()) != version:
        raise StudyError(
            f"{study.folder}: {missing} worlds are not judged yet, and the tool here is version {digest}, expected"
            f" {version or 'unknown'}, as the study has: check out the version that the study ran with and give --oracle there"
        )
    return tasks


def judged_table(
    scores: Sequence[Score],
    judged: Mapping[int, Mapping[str, Any]],
    sights: Mapping[int, Sight],
    seen: Mapping[int, bool],
) -> Table:
    """Against the oracle and the truth."""
    own = [s for s in scores if s.truth and s.world.seed in seen]
    clear = [s for s in own if seen[s.world.seed]]
    nameless = [s for s in scores if s.unnamed and seen.get(s.world.seed)]
    ratio = [
        _rms(s, "with_effects") / sights[s.world.seed].rms_true[HORIZON][0]
        for s in own
        if s.exact and _rms(s, "with_effects")
    ]
    gain = [
        _rms(s, "with_effects") / sights[s.world.seed].rms_nominal[HORIZON][0]
        for s in own
        if s.exact and _rms(s, "with_effects")
    ]
    found_first = [judged[s.world.seed] for s in scores if s.top1 and s.world.seed in judged]
    dof, times, regime, by_range = (
        _finite([content.get(key) for content in found_first])
        for key in ("dof", "overlap", "f1", "range_f1")
    )
    found = sum(s.in_set for s in clear) / len(clear) if clear else float("nan")
    rows = [
        [
            "truth in the answered set where the oracle detects",
            "at least 90 %",
            f"{found:.0%} of {len(clear)}",
        ],
        [
            "unexplained where there is no name for what the oracle detects",
            "at least 85 %",
            str(Share.of(nameless, lambda s: s.verdict == "unexplained")),
        ],
        [
            "held-out position error at 2 s over that of the true structure fitted, median",
            "at most 1.1",
            _median(ratio),
        ],
        ["the same over the refitted nominal structure, median", "", _median(gain)],
        [
            "degrees of freedom: overlap of their shares with those of the true structure fitted",
            "",
            _median(dof, "mean"),
        ],
        ["time overlap (IoU) of localised effects", "at least 0.7", _median(times, "mean")],
        [
            "regime F1: the samples in which a localised effect acts",
            "at least 0.9",
            _median(regime, "mean"),
        ],
        [
            "the same from the range of the one most telling covariate",
            "",
            _median(by_range, "mean"),
        ],
    ]
    note = (
        "The oracle starts from the true values and knows the name; errors where exactly the hidden names were given. Only "
        f"{JUDGED}; a world without an answer counts as not right."
    )
    return Table("Against the truth fitted", ["what", "asked", "measured"], rows, note)


def _rms(score: Score, model: str) -> float:
    """Held-out position error at 2 s [m]; 0 where not stated."""
    rows = score.rms.get(model, {})
    return number(rows.get("2 s", {}).get("position_m"), 0.0)


def _finite(values: Sequence[float | None]) -> list[float]:
    return [v for v in values if v is not None and np.isfinite(v)]


def _median(values: Sequence[float], kind: str = "median") -> str:
    if not values:
        return "–"
    size = np.median(values) if kind == "median" else np.mean(values)
    return f"{size:.2f} ({len(values)} worlds)"


def rivals_table(scores: Sequence[Score], rivals: Mapping[int, Mapping[str, Any]]) -> Table:
    """Competitors on the residual force of the refitted nominal model."""
    own = [s for s in scores if s.world.seed in rivals and len(s.truth) < 2]
    said = {s.world.seed: rivals[s.world.seed]["sindy"] for s in own}
    hidden, nothing = [s for s in own if s.truth], [s for s in own if s.world.group == "null"]
    answers = [s for s in nothing if s.has_answer]
    rows = [
        [
            "this tool",
            str(Share.of(hidden, lambda s: s.top1)),
            str(Share.of(answers, lambda s: s.alarm)),
            "",
        ],
        [
            "PySINDy",
            str(Share.of(hidden, lambda s: said[s.world.seed] in s.truth)),
            str(Share.of(nothing, lambda s: said[s.world.seed] is not None)),
            _median(_finite([rivals[s.world.seed]["sindy_r2"] for s in hidden])),
        ],
        [
            "neural network (fit only)",
            "gives none",
            "gives none",
            _median(_finite([rivals[s.world.seed]["neural_r2"] for s in hidden])),
        ],
    ]
    header = [
        "on the residual force",
        "right name first",
        "false alarms",
        "R2 of that force, held out, median",
    ]
    note = (
        "The residual force is that of the oracle's refit of the nominal model. A law is a name by its largest term. Only "
        f"{JUDGED}, with one hidden name or none: fewer nulls than in the other tables. A world without an answer counts as not "
        "right, a null without one does not count for the tool."
    )
    return Table("Competitors on the residual force", header, rows, note)
