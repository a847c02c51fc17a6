# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What else one could do: information criteria over the tool's refits, and fits of the residual force.

AIC, BIC and the smallest held-out error choose among the tool's own refits of all candidates. A sparse regression and a neural
network get the force that this project's own filter and smoother estimate from the refitted nominal model; neither refits
anything. The sparse regression is PySINDy's sequentially thresholded least squares (pip install -r requirements-bench.txt);
its name is that of its largest term.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fish_report.files import number
from fish_report.page import Table
from fish_sim.effects.effect import BodyMotion, Drive
from fish_sim.model import DT
from fish_sim.ops import NUMPY
from fish_study.score import Score
from fish_study.share import Share
from fish_sysid.dataset.experiment import Experiment
from fish_sysid.diagnosis.latent_force import MissingForce, missing_force
from fish_sysid.diagnosis.residual_regression import regressors
from fish_sysid.estimation.map_fit import Fit

Array = NDArray[np.float64]

THRESHOLD = 0.2  # of a force's standard deviation; a smaller standardised term is none
EVERY = 5  # grid points of 10 ms between samples
HIDDEN, ITERATIONS = (32, 32), 60  # of the network
NAMES = {  # term of the regression -> name it speaks for; other terms are laws without a name
    "surge_speed |surge_speed|": "quadratic_drag",
    "sway_speed |sway_speed|": "quadratic_drag",
    "yaw_rate |yaw_rate|": "quadratic_drag",
    "cos(heading)": "current",
    "sin(heading)": "current",
    "x": "nonuniform_current",
    "y": "nonuniform_current",
    "rudder": "rudder_gain",
    "surge_speed exp(-wall_distance/0.2 m)": "wall_effect",
}
SEEN = ("surge_speed", "sway_speed", "yaw_rate", "rudder", "rotor_speed", "wall_distance", "x", "y")


def criterion_table(scores: Sequence[Score]) -> Table:
    """AIC and BIC over the tool's own quick refits of all candidates, on the same scenarios."""
    counted = [s for s in scores if not s.unnamed and len(s.truth) < 2]
    hidden = [s for s in counted if s.truth]
    nothing = [s for s in counted if s.scenario.group == "null" and s.ranking]
    rows = []
    for name, cost in (("AIC", aic_cost), ("BIC", bic_cost)):
        right = [choice(s, cost) in s.truth for s in hidden]
        alarms = [choice(s, cost) is not None for s in nothing]
        rows.append(
            [name, str(Share(sum(right), len(right))), str(Share(sum(alarms), len(alarms)))]
        )
    right = [smallest_error(s) in s.truth for s in hidden]
    alarms = [smallest_error(s) is not None for s in nothing if s.held_out]
    rows.append(
        [
            "smallest held-out error",
            str(Share(sum(right), len(right))),
            str(Share(sum(alarms), len(alarms))),
        ]
    )
    rows.insert(
        0,
        [
            "this tool",
            str(Share.of(hidden, lambda s: s.top1)),
            str(Share.of(nothing, lambda s: s.alarm)),
        ],
    )
    note = (
        "Scenarios with one hidden name, and nulls. AIC and BIC choose among the quick refits of all names on the search "
        "trials; the smallest held-out position error 2 s ahead among the refitted nominal model and the names refitted "
        "with their own noise: for this one nulls count where the tool refitted a name at all. In a scenario "
        "without an answer there are no fits to choose among: no method is right there, and such nulls do not count."
    )
    return Table("Competitors", ["method", "right name first", "false alarms"], rows, note)


def choice(score: Score, cost: Callable[[str, Score], float]) -> str | None:
    """The name with the best penalised likelihood; None if the nominal model has it, or nothing was ranked."""
    if not score.ranking:
        return None
    best = max(score.ranking, key=lambda n: score.ranking[n] - cost(n, score))
    return best if score.ranking[best] > cost(best, score) else None


def smallest_error(score: Score) -> str | None:
    """The refitted name that predicts best on trials held out; None if the refitted nominal model does."""
    nominal = number(score.rms.get("refitted", {}).get("2 s", {}).get("position_m"), np.inf)
    best = min(score.held_out, key=lambda n: score.held_out[n], default=None)
    return best if best is not None and score.held_out[best] < nominal else None


def aic_cost(name: str, score: Score) -> float:
    """Nats for the free parameters of a name."""
    return float(_free(name, score))


def bic_cost(name: str, score: Score) -> float:
    """Nats: half the logarithm of the number of measurements that the ranking saw, for each parameter."""
    from fish_sysid.estimation.thresholds import FIRST_STEPS, SEARCH_TRIALS

    scenario = score.scenario
    trials = min(SEARCH_TRIALS, scenario.count - scenario.count // 3)  # a third is held out
    seconds = min(scenario.duration, DT * FIRST_STEPS)
    samples = trials * seconds * (100.0 * (4 if scenario.encoder else 3) + 3 * 30.0)
    return 0.5 * _free(name, score) * float(np.log(samples))


def _free(name: str, score: Score) -> int:
    """Numbers of a name as its answer tells; of answers that do not, as it has them now."""
    from fish_sysid.estimation.parametrization import effect_class

    return score.free[name] if name in score.free else len(effect_class(name).parameters)


@dataclass(frozen=True)
class CompetitorScores:
    """What the competitors say about one scenario."""

    sindy: (
        str | None
    )  # name of the largest term, its text if it has no name; None: no term is large enough
    sindy_r2: float  # of the residual force, held out
    neural_r2: float


def compete(nominal: Fit, training: Experiment, held_out: Experiment) -> CompetitorScores:
    """Both competitors on the residual force of a fit."""
    fitted, unseen = (missing_force(nominal, part) for part in (training, held_out))
    name, sindy_r2 = _sparse(fitted, unseen)
    return CompetitorScores(name, sindy_r2, _neural(fitted, unseen))


def terms(force: MissingForce) -> dict[str, Array]:
    """The terms (T, M) of a free force along a smoothed motion."""
    c = force.covariates
    moved = (c["surge_speed"], c["sway_speed"], c["yaw_rate"])
    head = BodyMotion(
        "head", c["x"], c["y"], np.cos(c["heading"]), np.sin(c["heading"]), *moved, 0.0, 0.0, 0.0
    )
    return regressors(head, c["time"], Drive(c["rudder"], 0.0, c["rotor_speed"], 0.0), NUMPY)


def _sparse(fitted: MissingForce, unseen: MissingForce) -> tuple[str | None, float]:
    from pysindy.optimizers import STLSQ

    library = terms(fitted)
    A, y = columns(library, fitted.wrench)
    B, z = columns(terms(unseen), unseen.wrench)
    middle, scale, size = A.mean(axis=0), A.std(axis=0) + 1e-12, y.std(axis=0) + 1e-12
    law = STLSQ(threshold=THRESHOLD, alpha=1e-3, normalize_columns=False)
    with (
        warnings.catch_warnings()
    ):  # it says so when no term is large enough, which is an answer here
        warnings.simplefilter("ignore", UserWarning)
        law.fit((A - middle) / scale, (y - y.mean(axis=0)) / size)
    found: Array = np.atleast_2d(law.coef_)
    predicted = (B - middle) / scale @ found.T * size + y.mean(axis=0)
    if not found.any():
        return None, 0.0
    largest = list(library)[int(np.argmax(np.abs(found).max(axis=0)))]
    return NAMES.get(largest, largest), r2(z, predicted)


def _neural(fitted: MissingForce, unseen: MissingForce) -> float:
    from sklearn.neural_network import MLPRegressor
    from sklearn.preprocessing import StandardScaler

    A, y = columns({k: fitted.covariates[k] for k in SEEN}, fitted.wrench)
    B, z = columns({k: unseen.covariates[k] for k in SEEN}, unseen.wrench)
    inputs, outputs = StandardScaler().fit(A), StandardScaler().fit(y)
    network = MLPRegressor(
        hidden_layer_sizes=HIDDEN, max_iter=ITERATIONS, early_stopping=True, random_state=0
    )
    network.fit(inputs.transform(A), outputs.transform(y))
    return r2(z, outputs.inverse_transform(network.predict(inputs.transform(B))))


def columns(library: Mapping[str, Array], wrench: Array) -> tuple[Array, Array]:
    """(samples, terms) and (samples, 3), every EVERY grid points, where all is known."""
    A = np.stack([v[::EVERY].ravel() for v in library.values()], axis=1)
    y = wrench[::EVERY].reshape(-1, 3)
    good = np.isfinite(A).all(axis=1) & np.isfinite(y).all(axis=1)
    return A[good], y[good]


def r2(true: Array, predicted: Array) -> float:
    """Mean over the degrees of freedom."""
    left, all_ = (
        ((true - predicted) ** 2).sum(axis=0),
        ((true - true.mean(axis=0)) ** 2).sum(axis=0),
    )
    return float(np.mean(1.0 - left / all_))
