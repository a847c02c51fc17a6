# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""After the labels are open: the oracle on every scenario, and the scores of an answer that need the truth.

Among them: where localised effects really act, and how well an answer's times and covariates agree with that.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fish_report.files import write_json
from fish_sim.model import DT
from fish_study.build import make_readings
from fish_study.competitors import CompetitorScores, compete
from fish_study.oracle import (
    as_experiment,
    fit_oracle,
    with_truth,
)
from fish_study.plant_effects import OUTSIDE
from fish_study.runner import spread
from fish_study.scenario import Scenario, ScenarioError
from fish_study.score import vocabulary
from fish_study.study import Study, StudyError, read_json
from fish_study.tool_version import checked_version, tool_digest
from fish_sysid.dataset.experiment import Experiment
from fish_sysid.diagnosis.effect_wrench import acting, effect_wrench, f1
from fish_sysid.diagnosis.latent_force import MissingForce, dof_shares
from fish_sysid.diagnosis.task import split_trials
from fish_sysid.diagnosis.vocabulary import candidates
from fish_sysid.estimation.ekf_types import Noise
from fish_sysid.estimation.map_fit import Fit, evaluate

LOCALISED = ("wall_effect", "wave_drag", "tether")  # they act here and not there
HORIZON = 1  # index of 2 s among the oracle's horizons
# of other scenarios no structure that the oracle could fit is the true one
COMPARABLE = "the simulator's fish with three tail links, no vortex among them"

Compete = Callable[[Fit, Experiment, Experiment], CompetitorScores]  # nominal, training, held out


def true_wrench(scenario: Scenario, experiment: Experiment) -> MissingForce | None:
    """What a scenario's only effect does on these trials if it is localised: the true robot along the motion it smooths."""
    if len(scenario.effects) != 1 or scenario.plant != "fish_sim" or scenario.links != 3:
        return None
    name = next(iter(scenario.effects))
    if name not in LOCALISED:
        return None
    hypothesis, theta = with_truth(scenario, (name,))
    return effect_wrench(evaluate(hypothesis, theta, experiment, Noise()), name, experiment)


def dof_overlap(stated: Mapping[str, float], true: Mapping[str, float]) -> float:
    """1 where two sets of shares over the degrees of freedom are equal, 0 where they have nothing in common."""
    return float(sum(min(share, true.get(name, 0.0)) for name, share in stated.items()))


def stated_times(
    stated: Sequence[Mapping[str, Any]], names: Sequence[str], length: int
) -> NDArray[np.bool_]:
    """(T, M) when the intervals stated say that an effect acts, on the trials `names`."""
    said = np.zeros((length, len(names)), dtype=bool)
    for interval in stated:
        if interval["trial"] in names:
            begin, end = round(interval["from"] / DT), round(interval["to"] / DT)
            said[begin:end, list(names).index(interval["trial"])] = True
    return said


def stated_range(
    stated: Sequence[Mapping[str, Any]], covariates: Mapping[str, NDArray[np.float64]]
) -> NDArray[np.bool_]:
    """(T, M) when the first covariate stated is in its range: the same said without knowing the recording."""
    value, (low, high) = covariates[stated[0]["name"]], stated[0]["range"]
    inside: NDArray[np.bool_] = (value >= low) & (value <= high)
    return inside


def overlap(said: NDArray[np.bool_], true: NDArray[np.bool_]) -> float:
    """Intersection over union."""
    return float((said & true).sum() / max((said | true).sum(), 1))


@dataclass(frozen=True)
class Task:
    """One scenario to be scored."""

    name: str
    scenario: Scenario
    folder: Path
    diagnosis: Mapping[str, Any] | None  # None: the tool gave no answer
    version: str = ""  # of the tool that the study examines; "": any

    @property
    def file(self) -> Path:
        """Where the scores are kept."""
        return self.folder / "oracle.json"


def score_task(task: Task) -> str:
    """Write oracle.json unless it is there; returns the scenario's name."""
    if not task.file.exists():
        version = checked_version(task.version, f"{task.name}, for the oracle")
        write_json(task.file, {**oracle_scores(task.scenario, task.diagnosis), "tool": version})
    return task.name


def oracle_scores(
    scenario: Scenario,
    diagnosis: Mapping[str, Any] | None,
    competitors: Compete = compete,
) -> dict[str, Any]:
    """The oracle's fits, overlap of degrees of freedom and of time, regime F1 (None where they mean nothing).

    A scenario without an answer has an oracle too: what the oracle finds there the tool has missed.
    """
    content: dict[str, Any] = {
        "fits": None,
        "dof": None,
        "overlap": None,
        "f1": None,
        "range_f1": None,
    }
    if (
        scenario.plant != "fish_sim" or scenario.links != 3
    ):  # of those no structure of the oracle's is the true one
        return content
    try:
        experiment = as_experiment(make_readings(scenario), scenario.encoder)
    except ScenarioError:
        return content
    held = _held_out(experiment) if diagnosis is None else diagnosis["fit"]["held_out_trials"]
    names = [n for n in scenario.names if n in vocabulary() or n in OUTSIDE]
    if not scenario.names:  # what an oracle that looks for something finds where nothing is
        names = [str(np.random.default_rng(scenario.seed).choice(candidates()))]
    answered = [] if diagnosis is None else [e for e in diagnosis["effects"] if _acts(e)]
    effects = [e for e in answered if e["name"] in scenario.names] or answered
    if names:
        fits = fit_oracle(scenario, experiment, held, names)
        content["fits"] = asdict(fits.result)
        shares = dof_shares(fits.nominal, fits.true)
        content["dof"] = dof_overlap(effects[0]["where"]["dof"], shares) if effects else None
        content["competitors"] = asdict(competitors(fits.nominal, fits.training, fits.held_out))
    trained = experiment.select([i for i, name in enumerate(experiment.names) if name not in held])
    wrench = true_wrench(scenario, trained) if effects else None
    if wrench is not None:
        acts, where = acting(wrench, np.array(Noise().wrench)), effects[0]["where"]
        stated = stated_times(where["time"], trained.names, len(acts))
        content["overlap"], content["f1"] = overlap(stated, acts), f1(stated, acts)
        content["range_f1"] = f1(stated_range(where["covariates"], wrench.covariates), acts)
    return content


def _acts(effect: Mapping[str, Any]) -> bool:
    """Whether the answer says where an effect acts; a symmetry test does not."""
    return bool(effect["where"]["dof"])


def _held_out(experiment: Experiment) -> list[str]:
    """As the diagnosis would have held them out."""
    return [experiment.names[i] for i in split_trials(experiment).held_out]


def score_studies(
    studies: Sequence[Study],
    jobs: int,
    done: Callable[[str], None],
    cluster: str = "",
) -> dict[int, dict[str, Any]]:
    """Seed -> the oracle's scores of every scenario of studies whose labels are open; what is there already is read.

    Raises StudyError where scores are missing and the tool here is not the study's, or where some are of another tool.
    """
    of_study = {study: _tasks(study) for study in studies}
    tasks = [task for own in of_study.values() for task in own]
    missing = []
    for task in tasks:
        if task.file.exists():
            done(task.name)
        else:
            missing.append(task)
    for name in spread(score_task, missing, jobs, cluster) if missing else ():
        done(name)
    for study, own in of_study.items():
        study.check_files("oracle.json", {t.name: read_json(t.file) for t in own})
    return {t.scenario.seed: read_json(t.file) for t in tasks}


def _tasks(study: Study) -> list[Task]:
    """One for each scenario. Raises StudyError where one has no scores yet and the tool here is not the study's."""
    results, version = study.results, study.about.get("tool", "")
    tasks = [
        Task(name, scenario, study.folder_of(name).resolve(), results[name]["diagnosis"], version)
        for name, scenario in study.scenarios.items()
    ]
    missing = sum(not task.file.exists() for task in tasks)
    if missing and (digest := tool_digest()) != version:
        raise StudyError(
            f"{study.folder}: {missing} scenarios have no scores of the oracle yet, and the tool here is version"
            f" {digest}, expected {version or 'unknown'}, as the study has: check out the version that the study ran with"
            " and give --oracle there"
        )
    return tasks
