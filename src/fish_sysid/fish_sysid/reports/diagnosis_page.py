# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The page of a diagnosis: verdict first, then where, symmetry tests, evidence, rivals, before and after, what to try next."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from fish_report.page import (
    Figure,
    Table,
    Text,
    write_page,
)
from fish_sysid.dataset.read import heading
from fish_sysid.diagnosis.diagnosis_json import LAGS
from fish_sysid.diagnosis.result import Diagnosis, Round, Screened
from fish_sysid.diagnosis.symmetry.finding import Estimate
from fish_sysid.diagnosis.vocabulary import known_effects, known_parameters
from fish_sysid.estimation.map_fit import Fit
from fish_sysid.reports.diagnosis_figures import (
    before_after,
    force_against_covariates,
    force_over_the_pool,
    force_over_time,
    moves_water,
    program,
    tells_when,
    water_over_the_pool,
    when_it_acts,
)
from fish_sysid.reports.verdict_sentence import by_prediction, by_symmetry, sentence

Content = dict[str, Any]

DENSITY = "log_density_per_sample"
NAT = (
    "A nat is a unit of log-likelihood: by n nats more, what was measured is e^n times as probable."
)
HEADER = ("test for", "answer", "numbers", "log gain on left-out trials", "assumes", "needs")
NOTE = (
    "Symmetries that no fish can break are broken by the pool, a clock or a sensor only, so these tests need no model of the "
    "fish. Log gain: logarithm of the mean square without the effect over that with it, on trials that took no part in the fit, "
    "with its standard error. Errors below 0.02 s (camera: 0.03 s), 0.02 rad and 1 % are not found: clocks, mounts and data "
    "sheets promise no better. Tests that assume a mirror-symmetric fish are shown and name nothing."
)


def write_diagnosis_page(path: Path, name: str, content: Content, d: Diagnosis) -> None:
    """Write report.html."""
    blocks: list[Text | Table | Figure] = [
        *(_found(entry) for entry in content["effects"]),
        symmetry_table(content["symmetry"]),
        *_own_effects(d),
        _fit_table(content, d.unseen_are),
        before_after(d),
        Figure(
            "Missing force over the pool",
            force_over_the_pool(d),
            "darker: more force missing in the refitted nominal model",
        ),
        Figure(
            "Missing force over time",
            force_over_time(d),
            "first training trial; grey: what remains with the effects found",
        ),
        Figure(
            "Missing force against covariates",
            force_against_covariates(d),
            "means over a tenth of the samples each, in standard deviations of usual water's force",
        ),
        *(
            water_over_the_pool(entry, d, d.task.robot.table)
            for entry in content["effects"]
            if moves_water(entry["name"], d.task.robot.table)
        ),
        *(when_it_acts(entry) for entry in content["effects"] if _acts_in_a_range(entry, d)),
        *_evidence(d),
        _whiteness(content),
        Text("Next experiment", content["next_experiment"]["why"]),
        Figure(
            "Its program",
            program(content),
            "commands to rotor and rudder; `robofish excite` swims it",
        ),
        Text("Out of reach", _unreachable(d)),
        *(Text(heading(text), text) for text in content.get("left_out", ())),
        Text("What remains", content["unexplained"]["description"]),
    ]
    write_page(path, f"Diagnosis of {name}", sentence(content), blocks)


def _acts_in_a_range(effect: Content, d: Diagnosis) -> bool:
    """Whether an effect pushes, and a range of a covariate predicts when."""
    push = d.pushes.get(effect["name"])
    return push is not None and tells_when(effect["where"], push)


def _found(effect: Content) -> Table:
    """Equation, parameters, where it acts and what it could be mistaken for."""
    rows = [
        [k, f"{p['value']:.4g}", f"{p['std']:.2g}", p["unit"]]
        for k, p in effect["parameters"].items()
    ]
    rivals = ", ".join(
        f"{r['name']} (probability {r['probability']:.2f})" for r in effect["rivals"]
    )
    note = (
        f"{effect['equation']}. {_explains(effect['where']['dof'])} "
        f"Could be mistaken for: {rivals or 'nothing else that was tried'}."
    )
    if by_prediction(effect):
        evidence = effect["evidence"]
        note = (
            f"{effect['equation']}. By predictions: with it trials left out cost {evidence['cost_ratio']:.2f} times as much as "
            f"without (p {evidence['p_value']:.2g}). Could be mistaken for: {rivals or 'none of its family that was judged'}."
        )
    if by_symmetry(effect):
        note = f"{effect['equation']}. By a symmetry test, without a model of the fish."
    return Table(
        f"What is missing: {effect['name']}",
        ["parameter", "value", "standard error", "unit"],
        rows,
        note,
    )


def _own_effects(d: Diagnosis) -> list[Table]:
    """The refitted effects and sensor errors of the given robot."""
    given = {**d.task.robot.effects, **d.task.robot.sensors}
    rows = [_own_row(name, given, d.final) for name in known_parameters(d.task.robot)]
    header = ["parameter", "given", "refitted", "standard error", "unit"]
    note = "Refitted together with the nominal parameters; these recordings say too little of the others to move them."
    return [Table("The given robot's own effects", header, rows, note)] if rows else []


def _own_row(name: str, given: Mapping[str, Mapping[str, float]], fit: Fit) -> list[str]:
    effect, key = name.split(".")
    value, unit = f"{given[effect][key]:.4g}", fit.hypothesis.effect(effect).parameters[key].unit
    if name not in fit.hypothesis.free:
        return [name, value, "", "", unit]
    return [name, value, f"{fit.values[name]:.4g}", f"{fit.standard_errors[name]:.2g}", unit]


def _explains(shares: Mapping[str, float]) -> str:
    """How the force that was missing without an effect is shared among the degrees of freedom."""
    if not any(shares.values()):
        return "No force was missing without it."
    parts = ", ".join(f"{share:.0%} in {dof}" for dof, share in shares.items())
    return f"Of the force that was missing without it (variance over that of the water's) acts {parts}."


OTHER_MODELS = {
    "with_symmetry": "with what symmetry tests find, in all",
    "model_yaml": "fitted to predict over seconds, described with",
}


def _fit_table(content: Content, trials: str) -> Table:
    """Errors on `trials`; the gain with its interval, where more than one trial tells how far it spreads."""
    fit, rows = content["fit"], []
    for label in ("nominal", "refitted", "with_effects"):
        entry = fit[label]
        cells = [_errors(v) for v in entry["rms"].values()]
        said = f"{label.replace('_', ' ')}{_marked(fit, label)}"
        rows.append([said, *cells, f"{entry[DENSITY]:.3f}"])
    for key, label in OTHER_MODELS.items():
        if fit.get(key):
            cells = [_errors(v) for v in fit[key]["rms"].values()]
            said = f"{label} {', '.join(fit[key]['effects']) or 'no effects'}{_marked(fit, key)}"
            rows.append([said, *cells, ""])
    header = [
        "model",
        *(f"{h}: m / rad / m/s" for h in fit["nominal"]["rms"]),
        "log density per sample",
    ]
    low, high = fit["improvement_ci95"]
    gain = f"{fit['with_effects'][DENSITY] - fit['refitted'][DENSITY]:.3f} nats per sample"
    spread = f", 95 % interval {low:.3f} to {high:.3f}" if np.isfinite(low) else ""
    held = ", ".join(fit["held_out_trials"]) or "none"
    note = f"Held out: {held}. {NAT} Gain of the effects over the refitted model: {gain}{spread}."
    return Table(f"Prediction errors on {trials}, before and after", header, rows, note)


def _marked(fit: Content, key: str) -> str:
    """Says which row is the model of model.yaml."""
    return " (model.yaml)" if fit.get("written") == key else ""


def _errors(rms: Mapping[str, float]) -> str:
    return f"{rms['position_m']:.3f} / {rms['heading_rad']:.3f} / {rms['speed_m_s']:.3f}"


EVIDENCE_HEADER = ("name", "quick gain, nats", "refitted gain, nats", "parameters")
EVIDENCE_NOTE = (
    f"{NAT} Every candidate is fitted together with all nominal parameters and the noise; "
    "gains are over the refitted model with the names of earlier rounds, so what its parameters absorb does not count. "
    "A quick gain is that of a short fit to a part of the trials: only the order counts, and below zero a name promises nothing. "
    "Names near the best one are refitted, and only these compete for the probability: one alone has 1.00 without a comparison. "
    "Parameters here are those of the trials that the search uses; the answer's are those of all training trials. "
    "Diverged: at the quick fit's values the model does not follow the recordings at all."
)


def _evidence(d: Diagnosis) -> list[Table]:
    tables = []
    for number, found in enumerate(d.state.rounds, 1):
        given = known_effects(d.task.robot)
        added = [name for name in found.base.hypothesis.names if name not in given]
        base = " + ".join(added) or ("the given model" if given else "the nominal model")
        rows = [_evidence_row(found, ranked) for ranked in found.ranking]
        title = f"Evidence, round {number}: what {base} lacks"
        tables.append(Table(title, EVIDENCE_HEADER, rows, EVIDENCE_NOTE))
    return tables


def _evidence_row(found: Round, ranked: Screened) -> list[str]:
    fit = found.refitted.get(ranked.name)
    quick = f"{ranked.gain:.0f}" if np.isfinite(ranked.gain) else "diverged"
    if fit is None:
        return [ranked.name, quick, "", ""]
    own = {k: v for k, v in fit.values.items() if k.startswith(ranked.name + ".")}
    values = ", ".join(
        f"{k.split('.')[1]} {v:.4g} ± {fit.standard_errors[k]:.2g}" for k, v in own.items()
    )
    return [ranked.name, quick, f"{found.gain(ranked.name):.0f}", values]


WHITENESS_NOTE = (
    "p of the Ljung-Box test: how probable residuals are that repeat themselves as much as these over "
    f"{LAGS} samples, were nothing but noise left in them; the worst trial's, times the number of trials (Bonferroni). "
    "Below 0.05 something is left in a row; near 1 nothing is seen there. Before: refitted; after: with the effects."
)


def _whiteness(content: Content) -> Table:
    p = content["fit"]["residual_whiteness_p"]
    rows = [
        [name, f"{p['before'][name]:.3g}", f"{p['after'].get(name, float('nan')):.3g}"]
        for name in p["before"]
    ]
    return Table("Are the residuals white?", ["row", "p before", "p after"], rows, WHITENESS_NOTE)


def _unreachable(d: Diagnosis) -> str:
    return (
        "; ".join(f"{name}: {why}" for name, why in d.task.not_judged.items())
        or "All candidates could be judged."
    )


def symmetry_table(tests: Sequence[Mapping[str, Any]], title: str = "Symmetry tests") -> Table:
    """Every test of diagnosis.json's `symmetry`."""
    return Table(title, HEADER, [_row(test) for test in tests], NOTE)


def numbers(parameters: Mapping[str, Mapping[str, Any]]) -> str:
    """`parameters` of diagnosis.json in a cell."""
    return ", ".join(f"{key} {Estimate(**p)}" for key, p in parameters.items())


def _row(test: Mapping[str, Any]) -> list[str]:
    told = test["evidence"]
    gain = ""
    if told:
        gain = f"{told['left_out_log_gain']:.2f} ± {told['left_out_log_gain_std']:.2f}"
    answer = ": ".join(part for part in (test["status"], test["reason"]) if part)
    return [test["name"], answer, numbers(test["parameters"]), gain, test["assumes"], test["needs"]]
