# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What an answer is worth once the label is open."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from fish_report.files import number
from fish_sim.effects import EFFECTS
from fish_sim.sensors import SENSOR_EFFECTS
from fish_study.plant_effects import MEANS
from fish_study.scenario import Scenario
from fish_study.study import Study

CONFIDENT = 0.9  # stated probability from which a wrong name counts as given with confidence; fixed before any run
NOTHING = "no_mismatch"
FAILED = "failed"  # in place of a verdict
CHANGED = {"changed": True, "unchanged": False}


def true_names(scenario: Scenario) -> tuple[str, ...] | None:
    """Names of the vocabulary; None: the hidden effects' own names."""
    if scenario.plant != "mujoco":
        other = set(scenario.names) & set(MEANS)
        return tuple(MEANS.get(name, name) for name in scenario.names) if other else None
    from fish_study.mujoco_effects import CONCEALED

    return tuple(name for hidden in scenario.names for name in CONCEALED[hidden].names)


@dataclass(frozen=True)
class ParameterError:
    """One parameter of an effect that was found."""

    name: str  # effect.parameter
    true: float
    found: float
    std: float

    @property
    def within(self) -> bool:
        """Three standard errors or 20 %: what is asked."""
        error = abs(self.found - self.true)
        return error <= 3.0 * self.std or error <= 0.2 * abs(self.true)


@dataclass(frozen=True)
class Score:
    """One scenario. Truth: names of the vocabulary that are hidden; unnamed: something without a name is hidden."""

    scenario: Scenario
    truth: tuple[str, ...]
    unnamed: bool
    verdict: str  # of the tool; "failed" if it gave none
    named: tuple[str, ...]  # effects, the first found first
    answered: frozenset[str]  # effects and rivals
    probability: float  # stated for the first name; NaN without one
    kinds: tuple[str, ...]  # of the named
    parameters: tuple[ParameterError, ...]
    rms: Mapping[str, Any]  # model -> horizon -> errors, as in diagnosis.json
    ranking: Mapping[str, float]  # name -> quick gain, nats
    free: Mapping[
        str, int
    ]  # name -> numbers it took in the ranking; empty in answers that do not tell
    seconds: float
    error: str = ""  # why there is no answer
    changed: bool | None = (
        None  # whether NEW differs from a baseline; None: not asked, or not comparable
    )
    # of each effect (names that it and its family give, probability of the first)
    stated: tuple[tuple[frozenset[str], float], ...] = ()
    # refitted name -> position error 2 s ahead on held-out trials [m]
    held_out: Mapping[str, float] = field(default_factory=dict)

    @property
    def has_answer(self) -> bool:
        """The tool came to an end."""
        return self.verdict != FAILED

    @property
    def top1(self) -> bool:
        """The first name is a hidden one."""
        return bool(self.named) and self.named[0] in self.truth

    @property
    def in_set(self) -> bool:
        """Every hidden name is an effect or a rival in the answer."""
        return bool(self.truth) and set(self.truth) <= self.answered

    @property
    def exact(self) -> bool:
        """An answer with all hidden names and no other."""
        return self.has_answer and set(self.named) == set(self.truth)

    @property
    def alarm(self) -> bool:
        """The tool says that something is missing."""
        return self.has_answer and self.verdict != NOTHING

    @property
    def false_names(self) -> tuple[str, ...]:
        """Names given that are not hidden."""
        return tuple(n for n in self.named if n not in self.truth)

    @property
    def confident_wrong(self) -> bool:
        """The first name is wrong and was stated with confidence."""
        return bool(self.named) and not self.top1 and self.probability >= CONFIDENT

    @property
    def in_family(self) -> bool:
        """Every hidden name is in an effect's stated family."""
        return bool(self.truth) and all(
            any(t in names for names, _ in self.stated) for t in self.truth
        )

    @property
    def wrong_alone(self) -> bool:
        """An effect that is stated with confidence and has no hidden name in its family."""
        return any(p >= CONFIDENT and not names & set(self.truth) for names, p in self.stated)

    @property
    def called_physics(self) -> bool:
        """A physics name was given."""
        return "physics" in self.kinds


def vocabulary() -> frozenset[str]:
    """The names a label may have that the tool can answer."""
    return frozenset({*EFFECTS, *SENSOR_EFFECTS} - {"disturbance"})


def score_scenario(
    scenario: Scenario, result: Mapping[str, Any], truth: tuple[str, ...] | None = None
) -> Score:
    """Score a result. truth: names that count as right, for a plant whose effects have other names (default: its own)."""
    known = vocabulary()
    names = tuple(n for n in scenario.names if n in known) if truth is None else truth
    unnamed = bool(scenario.names) and not names
    d = result.get("diagnosis")
    if d is None:
        return Score(
            scenario=scenario,
            truth=names,
            unnamed=unnamed,
            verdict=FAILED,
            named=(),
            answered=frozenset(),
            probability=float("nan"),
            kinds=(),
            parameters=(),
            rms={},
            ranking={},
            free={},
            seconds=result["seconds"],
            error=result["error"],
        )
    effects = d["effects"]
    rivals = {rival["name"] for e in effects for rival in e["rivals"]}
    fit = d.get("fit", {})
    return Score(
        scenario=scenario,
        truth=names,
        unnamed=unnamed,
        verdict=d["verdict"],
        named=tuple(e["name"] for e in effects),
        answered=frozenset({e["name"] for e in effects} | rivals),
        probability=effects[0]["evidence"]["probability"] if effects else float("nan"),
        kinds=tuple(e["kind"] for e in effects),
        parameters=tuple(p for e in effects for p in _parameter_errors(scenario, e)),
        rms={k: fit[k]["rms"] for k in ("nominal", "refitted", "with_effects") if k in fit},
        ranking={r["name"]: number(r["gain"], -np.inf) for r in d.get("ranking", ())},
        free={
            r["name"]: r["free_parameters"] for r in d.get("ranking", ()) if "free_parameters" in r
        },
        seconds=result["seconds"],
        held_out={r["name"]: _position(r["held_out_rms"]) for r in d.get("refitted", ())},
        changed=CHANGED.get(d.get("change", {}).get("verdict", "")),
        stated=tuple(_stated(e) for e in effects),
    )


def _stated(effect: Mapping[str, Any]) -> tuple[frozenset[str], float]:
    """The names that an effect of an answer gives, and how sure the first is."""
    rivals = {rival["name"] for rival in effect["rivals"]}
    return frozenset({effect["name"], *rivals}), float(effect["evidence"]["probability"])


def _position(rms: Mapping[str, Any]) -> float:
    """Position error 2 s ahead [m]; infinite where no trial is that long."""
    return number(rms.get("2 s", {}).get("position_m"), np.inf)


def _parameter_errors(scenario: Scenario, effect: Mapping[str, Any]) -> list[ParameterError]:
    hidden = scenario.effects.get(effect["name"], {})
    return [
        ParameterError(f"{effect['name']}.{key}", hidden[key], number(p["value"]), number(p["std"]))
        for key, p in effect["parameters"].items()
        if key in hidden
    ]


def study_scores(study: Study) -> list[Score]:
    """Scores of every scenario of a study. Opens its labels; raises StudyError where that is too early."""
    results = study.results
    return [
        score_scenario(scenario, results[name], true_names(scenario))
        for name, scenario in study.open_labels().items()
    ]
