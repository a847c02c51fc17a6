# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""diagnosis.json: the answer in the project's fixed format."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy import stats

from fish_sim.robot import Robot
from fish_sysid.diagnosis import latent_force
from fish_sysid.diagnosis.corrected_model import (
    corrected,
    much_is_left,
    named,
    refused,
    unexplained_share,
    verdict,
)
from fish_sysid.diagnosis.effect_wrench import intervals, regimes
from fish_sysid.diagnosis.next_experiment import next_experiment
from fish_sysid.diagnosis.prediction_evidence import (
    effect_parameters,
    prediction_effects,
    prediction_entries,
)
from fish_sysid.diagnosis.result import Accepted, Diagnosis, Round
from fish_sysid.diagnosis.significance import p_value, probabilities
from fish_sysid.diagnosis.symmetry.outcome import symmetry_entry, with_symmetry
from fish_sysid.diagnosis.vocabulary import family_of, kind_of, separating
from fish_sysid.estimation.ekf_types import ROWS, Noise
from fish_sysid.estimation.map_fit import Fit
from fish_sysid.estimation.thresholds import PLAUSIBLE
from fish_sysid.prediction.prediction import EVERY, HORIZONS, WARM_UP, predict, prediction_errors

LAGS = 20  # samples of a row over which residuals must be white
MISSES = (
    "from no start state does the model follow two seconds of swimming, whatever effects it has: it misses by {:.1f} times the "
    "camera's noise, and no name is searched for by likelihood"
)
STRONG = "a force {:.0f}, {:.0f} and {:.0f} times as dense as usual water in surge, sway and yaw"


def answer(d: Diagnosis) -> dict[str, Any]:
    """The dictionary written to diagnosis.json."""
    unexplained, fit = unexplained_entry(d), corrected(d)
    effects = [*(effect_entry(d, a, fit) for a in named(d)), *prediction_effects(d)]
    stated = [[e["name"], *(rival["name"] for rival in e["rivals"])] for e in effects]
    grows_with = next((c["name"] for c in unexplained["where"].get("covariates", [])), None)
    return {
        "verdict": verdict(d),
        "effects": with_symmetry(effects, d.symmetry, d.task.robot.table),
        "symmetry": symmetry_entry(d.symmetry),
        "unexplained": unexplained,
        "fit": fit_entry(d, fit),
        "next_experiment": separating(stated)
        or next_experiment([a.name for a in named(d)], rivals(d), grows_with),
        "out_of_reach": d.task.not_judged,
        "ranking": [
            {"name": r.name, "gain": r.gain, "free_parameters": d.task.parameter_count(r.name)}
            for first in d.state.rounds[:1]
            for r in first.ranking
        ],
        "refitted": [
            refitted_entry(d, first, name, fit)
            for first in d.state.rounds[:1]
            for name, fit in first.refitted.items()
        ],
    }


def refitted_entry(d: Diagnosis, first: Round, name: str, fit: Fit) -> dict[str, Any]:
    """A candidate of the first round that was refitted on the search trials, whether it was chosen or not."""
    return {
        "name": name,
        "gain": first.gain(name),
        "parameters": effect_parameters(fit, name),
        "held_out_rms": held_out_errors(d, fit.robot, fit.noise),
    }


def effect_entry(d: Diagnosis, accepted: Accepted, fit: Fit) -> dict[str, Any]:
    """One found effect, with the numbers of model.yaml, whose fit this is, if it stands there."""
    name, found = accepted.name, accepted.round
    gains = {a.name: a.round.gain(a.name) for a in d.accepted}
    probability = competition(accepted, d.accepted)
    effect = d.final.hypothesis.effect(name)
    return {
        "name": name,
        "kind": kind_of(name, d.task.robot.table),
        "equation": effect.equation,
        "parameters": effect_parameters(fit if name in fit.hypothesis.names else d.final, name),
        "evidence": {
            "basis": "likelihood",
            "log_likelihood_gain": gains[name],
            "p_value": p_value(gains[name], len(effect.parameters), len(found.ranking)),
            "probability": probability[name],
        },
        "share": gains[name] / sum(gains.values()),
        "rivals": [{"name": n, "probability": p} for n, p in rivals_of(d, accepted).items()],
        "family": family_entry(d, accepted),
        "where": where_entry(d, name),
    }


def competition(accepted: Accepted, found: Sequence[Accepted]) -> dict[str, float]:
    """Probability of a name and of its rivals, most probable first; what was found as well explains something else."""
    others = {other.name for other in found} - {accepted.name}
    return probabilities(
        {name: fit for name, fit in accepted.contest.items() if name not in others}
    )


def rivals(d: Diagnosis) -> list[str]:
    """Names that the data do not distinguish from what was found."""
    return [name for accepted in named(d) for name in rivals_of(d, accepted)]


def rivals_of(d: Diagnosis, accepted: Accepted) -> dict[str, float]:
    """Names that the data do not distinguish from one that was found, with their probabilities."""
    probability = competition(accepted, d.accepted)
    return {n: p for n, p in probability.items() if n != accepted.name and p > PLAUSIBLE}


def family_entry(d: Diagnosis, accepted: Accepted) -> dict[str, Any]:
    """The name of the family and those of its members that tie, each with its probability and parameters."""
    family = family_of(accepted.name)
    alike = [n for n in rivals_of(d, accepted) if family and family_of(n) == family]
    if not alike:
        return {"name": "", "members": []}
    probability = competition(accepted, d.accepted)
    return {
        "name": family,
        "members": [
            {
                "name": n,
                "probability": probability[n],
                "parameters": effect_parameters(accepted.contest[n], n),
            }
            for n in (accepted.name, *alike)
        ],
    }


def where_entry(d: Diagnosis, name: str) -> dict[str, Any]:
    """Degrees of freedom, covariates, times and places of an effect: of its push, or of the force that is missing without it."""
    without, missing = d.parts.get(name, (d.nominal, d.force))
    scale, push = np.array(d.final.noise.wrench), d.pushes.get(name)
    return {
        "dof": latent_force.dof_shares(without, d.final),
        "covariates": latent_force.covariate_shares(missing, scale)
        if push is None
        else regimes(push, scale),
        "time": latent_force.time_shares(missing, scale)
        if push is None
        else intervals(push, scale),
        "place": latent_force.place_shares(push or missing, scale),
    }


def unexplained_entry(d: Diagnosis) -> dict[str, Any]:
    """What no name explains: size, place, and a law of few terms."""
    share, limits = unexplained_share(d), refused(d)
    if not much_is_left(d):
        text = "the remaining force looks like water noise"
        return {
            "share": share,
            "where": {},
            "nearest": [],
            "by_prediction": [],
            "description": "; ".join([*unreached(d), *(limits or [text])]),
        }
    scale, ratio = np.array(d.final.noise.wrench), d.final.process_noise_ratio
    laws = [*limits, *(law(d, dof) for dof in d.state.law.lawful(d.task.level))]
    return {
        "share": share,
        "where": {
            "dof": dict(zip(latent_force.DOFS, (ratio / ratio.sum()).tolist(), strict=True)),
            "covariates": latent_force.covariate_shares(d.remaining, scale),
            "time": latent_force.time_shares(d.remaining, scale),
            "place": latent_force.place_shares(d.remaining, scale),
        },
        "nearest": [a.name for a in d.accepted if a not in named(d)],  # help, but leave most of it
        "by_prediction": prediction_entries(d),
        "description": "; ".join(
            [*unreached(d), *(laws or [f"{STRONG.format(*ratio)}; {no_law(d)}"])]
        ),
    }


def unreached(d: Diagnosis) -> list[str]:
    """That no name was searched for, where the model cannot follow the fish."""
    return [MISSES.format(d.misses)] if d.misses is not None else []


def no_law(d: Diagnosis) -> str:
    """Why no law of the remaining force is stated."""
    if len(d.task.split.training) < 2:
        return "a single training trial: no law of it could be judged"
    return "no law in place, time, speed, rotor, rudder or heading was found for it"


def law(d: Diagnosis, dof: str) -> str:
    """The remaining force along one degree of freedom in few terms."""
    terms = " + ".join(f"({c:.3g}) {term}" for term, c in d.state.law.terms[dof].items())
    return f"{dof} = {terms} (SI units; {d.state.law.gain[dof]:.0f} nats on trials that it was not fitted to)"


def fit_entry(d: Diagnosis, fit: Fit) -> dict[str, Any]:
    """Errors and log density on held-out trials (or training trials), before and after; fit: that model.yaml holds."""
    robots = {
        "nominal": (d.task.robot, d.given_noise),
        "refitted": (d.nominal.robot, d.nominal.noise),
        "with_effects": (d.final.robot, d.final.noise),
    }
    surrogate = d.surrogate and described(d, d.surrogate)
    settled = d.settled and described(d, d.settled)
    entries = {
        name: {
            "rms": held_out_errors(d, robot, noise),
            "log_density_per_sample": float(np.mean(d.held_out[name])),
        }
        for name, (robot, noise) in robots.items()
    }
    gain = d.held_out["with_effects"] - d.held_out["refitted"]
    return {
        "held_out_trials": [d.task.experiment.names[i] for i in d.task.split.held_out],
        # the trials of every rms and density, `held_out_rms` of `refitted` included: too few trials hold none out
        "errors_are_of": "held_out" if d.task.split.held_out else "training",
        **entries,
        "written": written(d, fit),
        "holds": list(fit.hypothesis.names),  # effects and sensor errors in model.yaml
        "with_symmetry": settled,  # the search's model with what only symmetry tests find
        "model_yaml": surrogate,  # where no name fits: the structure that predicts best over seconds
        "tail_links": {"given": d.task.robot.links, "used": d.final.robot.links},
        "noise_floor": {
            "wrench_std": list(map(float, d.final.noise.wrench)),
            "unit": ["N", "N", "N m"],
            "correlation_time_s": float(d.final.noise.wrench_time),
        },
        "improvement_ci95": mean_interval(gain if d.task.split.held_out else gain[:0]),
        "residual_whiteness_p": {"before": whiteness(d.nominal), "after": whiteness(d.final)},
    }


def described(d: Diagnosis, fit: Fit) -> dict[str, Any]:
    """A model by its effects, which are a description and no findings, and its errors."""
    rms = held_out_errors(d, fit.robot, fit.noise)
    return {"effects": list(fit.hypothesis.names), "rms": rms}


def written(d: Diagnosis, fit: Fit) -> str:
    """Which model model.yaml holds, as it holds this fit: refitted, with_symmetry, with_effects or model_yaml."""
    if fit is d.nominal:
        return "refitted"
    if fit is d.settled:
        return "with_symmetry"
    return "model_yaml" if fit is d.surrogate else "with_effects"


def held_out_errors(d: Diagnosis, robot: Robot, noise: Noise) -> dict[str, dict[str, float]]:
    """Prediction errors of a robot on `Diagnosis.unseen`: horizon -> position, heading, speed."""
    made = predict(d.unseen, robot, noise, max(HORIZONS), EVERY, WARM_UP)
    sizes, names = prediction_errors(made, HORIZONS), ("position_m", "heading_rad", "speed_m_s")
    return {
        f"{h:g} s": dict(zip(names, map(float, row), strict=True))
        for h, row in zip(sizes.horizons, sizes.rms, strict=True)
    }


def mean_interval(gain: np.ndarray) -> list[float]:
    """95 % interval of the mean gain per trial (Student 1908: normally distributed); NaN of fewer than two.

    Of two to six trials resampled ones would hold the mean in 51 to 87 % of cases.
    """
    if len(gain) < 2:
        return [float("nan")] * 2
    half = float(stats.t.isf(0.025, len(gain) - 1) * stats.sem(gain))
    return [float(gain.mean()) - half, float(gain.mean()) + half]


def whiteness(fit: Fit) -> dict[str, float]:
    """Ljung-Box p value over LAGS samples of each row of innovations (the worst trial's, times the number of trials)."""
    from statsmodels.stats.diagnostic import acorr_ljungbox

    values = {}
    for row, name in enumerate(ROWS):
        p = []
        for m in range(fit.result.whitened.shape[1]):
            series = fit.result.whitened[:, m, row]
            series = series[np.isfinite(series)]
            if len(series) > 3 * LAGS:
                p.append(float(acorr_ljungbox(series, [LAGS])["lb_pvalue"].iloc[0]))
        if p:
            values[name] = min(1.0, min(p) * len(p))
    return values
