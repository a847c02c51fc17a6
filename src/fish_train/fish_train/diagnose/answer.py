"""diagnosis.json: the answer in the project's fixed format."""

from __future__ import annotations

from typing import Any

import numpy as np

from fish_sim.effects import EFFECTS
from fish_sim.robot import Robot
from fish_sim.sensors import SENSOR_EFFECTS
from fish_train.diagnose import locate
from fish_train.diagnose.decide import PLAUSIBLE, excess, p_value, parameter_count, probabilities
from fish_train.diagnose.diagnosis import UNEXPLAINED_R2, Accepted, Diagnosis
from fish_train.diagnose.experiment_plan import next_experiment
from fish_train.diagnose.search import evidence
from fish_train.diagnose.vocabulary import kind_of
from fish_train.identify.experiment import Experiment
from fish_train.identify.filter_types import ROWS, Noise
from fish_train.identify.fit import Fit
from fish_train.identify.hypothesis import specification
from fish_train.identify.prediction import predict, prediction_errors
from fish_train.identify.settle import suitable_noise

HORIZONS = (1.0, 2.0, 5.0)
# times the density of usual water: five times its standard deviation, more than the noisiest pool that is still a pool
TOO_STRONG = 30.0
STRONG = "a force {:.0f}, {:.0f} and {:.0f} times as dense as usual water in surge, sway and yaw"


def verdict(d: Diagnosis) -> str:
    """no_mismatch, missing_physics, sensor_or_actuator or unexplained."""
    found = named(d)
    if not found:
        return "unexplained" if much_is_left(d) else "no_mismatch"
    kinds = {kind_of(a.name) for a in found}
    return "missing_physics" if "physics" in kinds else "sensor_or_actuator"


def much_is_left(d: Diagnosis) -> bool:
    """The wrench that remains follows a law on trials that the law was not fitted to, or is far stronger than water."""
    return has_law(d) or bool(excess(d.final).max() > TOO_STRONG)


def has_law(d: Diagnosis) -> bool:
    """A sparse regression of the remaining wrench holds on trials that it was not fitted to."""
    return max(d.description.r2.values()) > UNEXPLAINED_R2


def named(d: Diagnosis) -> tuple[Accepted, ...]:
    """The accepted effects, or none where they leave more than they take away: nearest is not right."""
    return () if much_is_left(d) and unexplained_share(d) > 0.5 else d.accepted


def corrected(d: Diagnosis) -> Fit:
    """The fit that model.yaml holds."""
    return d.final if named(d) else d.nominal


def unexplained_share(d: Diagnosis) -> float:
    """Part of the mismatch that is still there: densities of the wrench beyond those of usual water."""
    final, nominal = excess(d.final), excess(d.nominal)
    left, removed = np.sum(np.maximum(final - 1.0, 0.0)), np.sum(np.maximum(nominal - final, 0.0))
    return float(left / (left + removed)) if left + removed > 0 else 0.0


def answer(d: Diagnosis) -> dict[str, Any]:
    """The dictionary written to diagnosis.json."""
    return {
        "verdict": verdict(d),
        "effects": [effect_entry(d, a) for a in named(d)],
        "unexplained": unexplained_entry(d),
        "fit": fit_entry(d),
        "next_experiment": next_experiment([a.name for a in named(d)], rivals(d)),
        "out_of_reach": d.unreachable,
        "ranking": [{"name": r.name, "gain": r.gain} for r in d.rounds[0].ranking],
        "refitted": [refitted_entry(d, name, fit) for name, fit in d.rounds[0].refitted.items()],
    }


def refitted_entry(d: Diagnosis, name: str, fit: Fit) -> dict[str, Any]:
    """A candidate of the first round that was refitted on the search trials, whether it was chosen or not."""
    errors = held_out_errors(d, fit.robot, fit.noise)
    return {
        "name": name,
        "gain": d.rounds[0].gain(name),
        "parameters": effect_parameters(fit, name),
        "held_out_rms": errors,
    }


def effect_entry(d: Diagnosis, accepted: Accepted) -> dict[str, Any]:
    """One found effect."""
    name, found = accepted.name, accepted.round
    gains = {a.name: a.round.gain(a.name) for a in d.accepted}
    tried = len(found.ranking)
    odds = competition(accepted)
    return {
        "name": name,
        "kind": kind_of(name),
        "equation": {**EFFECTS, **SENSOR_EFFECTS}[name].equation,
        "parameters": effect_parameters(d.final, name),
        "evidence": {
            "log_likelihood_gain": gains[name],
            "p_value": p_value(gains[name], parameter_count(name), tried),
            "probability": odds[name],
        },
        "share": gains[name] / sum(gains.values()),
        "rivals": [{"name": n, "probability": p} for n, p in odds.items() if n != name and p > PLAUSIBLE],
        "where": where_entry(d.force, d.nominal, d.final),
    }


def competition(accepted: Accepted) -> dict[str, float]:
    """Probability of each refitted name of the round, most probable first."""
    objectives = {n: evidence(f) for n, f in accepted.round.refitted.items()}
    odds = probabilities(objectives)
    return dict(sorted(odds.items(), key=lambda item: -item[1]))


def rivals(d: Diagnosis) -> list[str]:
    """Names that the data cannot tell from what was found."""
    return [n for a in named(d) for n, p in competition(a).items() if n != a.name and p > PLAUSIBLE]


def effect_parameters(fit: Fit, name: str) -> dict[str, dict[str, Any]]:
    """Values, standard errors and units of an effect's parameters."""
    values, errors = fit.values, fit.standard_errors
    return {
        key: {"value": values[f"{name}.{key}"], "std": errors[f"{name}.{key}"], "unit": parameter.unit}
        for key, parameter in specification(name).items()
    }


def where_entry(force: locate.MissingForce, nominal: Fit, final: Fit) -> dict[str, Any]:
    """Degrees of freedom, covariates, times and places."""
    scale = np.array(final.noise.wrench)
    return {
        "dof": locate.dof_shares(nominal, final),
        "covariates": locate.covariate_shares(force, scale),
        "time": locate.time_shares(force, scale),
        "place": locate.place_shares(force, scale),
    }


def unexplained_entry(d: Diagnosis) -> dict[str, Any]:
    """What no name explains: size, place, and a sparse regression."""
    r2 = d.description.r2
    share = unexplained_share(d)
    if not much_is_left(d):
        return {"share": share, "where": {}, "description": "the remaining force looks like water noise"}
    worst = max(r2, key=lambda dof: r2[dof])
    law = " + ".join(f"({c:.3g}) {term}" for term, c in d.description.terms[worst].items())
    scale = np.array(d.final.noise.wrench)
    return {
        "share": share,
        "where": {
            "dof": dict(zip(locate.DOFS, (excess(d.final) / excess(d.final).sum()).tolist(), strict=True)),
            "covariates": locate.covariate_shares(d.remaining, scale),
            "time": locate.time_shares(d.remaining, scale),
            "place": locate.place_shares(d.remaining, scale),
        },
        "nearest": [a.name for a in d.accepted if a not in named(d)],  # help, but leave most of it
        "description": f"{worst} = {law} (SI units; explains {r2[worst]:.0%} of it on unseen trials)"
        if has_law(d)
        else f"{STRONG.format(*excess(d.final))}; no law in place, speed, rudder or heading was found for it",
    }


def fit_entry(d: Diagnosis) -> dict[str, Any]:
    """Prediction errors and log density on held-out trials, before and after."""
    given = suitable_noise(
        unseen(d), d.robot, d.nominal.noise
    )  # at the refitted noise its filter would lose the fish
    robots = {"nominal": (d.robot, given), "refitted": (d.nominal.robot, d.nominal.noise),
              "with_effects": (d.final.robot, d.final.noise)}  # fmt: skip
    entries = {
        name: {
            "rms": held_out_errors(d, robot, noise),
            "log_density_per_sample": float(np.mean(d.held_out[name])),
        }
        for name, (robot, noise) in robots.items()
    }
    gain = d.held_out["with_effects"] - d.held_out["refitted"]
    return {
        "held_out_trials": [d.experiment.names[i] for i in d.split.held_out],
        **entries,
        "tail_links": {"given": d.robot.links, "used": d.final.robot.links},
        "noise_floor": {"wrench_std": list(map(float, d.final.noise.wrench)), "unit": ["N", "N", "N m"],
                        "correlation_time_s": float(d.final.noise.wrench_time)},
        "improvement_ci95": bootstrap_interval(gain),
        "residual_whiteness_p": {"before": whiteness(d.nominal), "after": whiteness(d.final)},
    }  # fmt: skip


def unseen(d: Diagnosis) -> Experiment:
    """The held-out trials, or where there are too few the training trials."""
    return d.experiment.select(d.split.held_out or d.split.training)


def held_out_errors(d: Diagnosis, robot: Robot, noise: Noise) -> dict[str, dict[str, float]]:
    """Prediction errors of a robot on the held-out trials: horizon -> position, heading, speed."""
    sizes = prediction_errors(predict(unseen(d), robot, noise, max(HORIZONS)), HORIZONS)
    return {
        f"{h:g} s": dict(zip(("position_m", "heading_rad", "speed_m_s"), map(float, row), strict=True))
        for h, row in zip(sizes.horizons, sizes.rms, strict=True)
    }


def bootstrap_interval(gain: np.ndarray) -> list[float]:
    """95 % interval of the mean gain per trial, by resampling trials."""
    rng = np.random.default_rng(0)
    means = rng.choice(gain, (4000, len(gain))).mean(axis=1)
    return [float(q) for q in np.quantile(means, [0.025, 0.975])]


def whiteness(fit: Fit, lags: int = 20) -> dict[str, float]:
    """Ljung-Box p value of each row of innovations (the worst trial's, times the number of trials)."""
    from statsmodels.stats.diagnostic import acorr_ljungbox

    values = {}
    for row, name in enumerate(ROWS):
        p = []
        for m in range(fit.result.whitened.shape[1]):
            series = fit.result.whitened[:, m, row]
            series = series[np.isfinite(series)]
            if len(series) > 3 * lags:
                p.append(float(acorr_ljungbox(series, [lags])["lb_pvalue"].iloc[0]))
        if p:
            values[name] = min(1.0, min(p) * len(p))
    return values
