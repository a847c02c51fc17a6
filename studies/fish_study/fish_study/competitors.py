# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What else one could do with the residual force of the refitted nominal model: sparse regression, a neural network.

Both get the force that this project's own filter and smoother estimate; neither refits anything. The sparse regression is
PySINDy's sequentially thresholded least squares (pip install -r requirements-bench.txt); its name is that of its largest term.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fish_sim.effects.effect import BodyMotion, Drive
from fish_sim.ops import NUMPY
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
