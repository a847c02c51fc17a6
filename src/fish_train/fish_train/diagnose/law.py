"""A law for the missing force: a sparse regression on what the fish did, and what it would be worth as a force of the model."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from sklearn.linear_model import OrthogonalMatchingPursuit

from fish_sim.model import DT
from fish_train.diagnose.locate import DOFS, MissingForce
from fish_train.identify.filter_types import Array, Noise

REGRESSORS = 4  # of the sparse description


@dataclass(frozen=True)
class Description:
    """A sparse regression of the missing wrench, judged on trials it has not seen."""

    r2: dict[str, float]  # per degree of freedom, cross-validated by trial
    gain: dict[str, float]  # nats that the law would gain as a force of the model, cross-validated, at least
    terms: dict[str, dict[str, float]]  # degree of freedom -> regressor -> coefficient (SI)
    tried: int  # regressors that it could choose from


def describe(force: MissingForce, noise: Noise) -> Description:
    """What the missing force looks like: at most REGRESSORS products of covariates per degree of freedom.

    A known force f added to the model raises the log likelihood by at least (w' K^-1 w - (w - f)' K^-1 (w - f)) / 2, where
    w is the smoothed wrench and K the covariance that the filter assumes for it (from Gaussian conditioning, as in
    Rasmussen and Williams 2006, appendix A.2; the posterior's covariance, left out, would add to it).
    """
    library = regressors(force.covariates)
    trials = list(range(len(force.names)))
    r2, gain, terms = {}, {}, {}
    for i, dof in enumerate(DOFS):
        wrench, scores, weights, nats = force.wrench[..., i], [], [], 0.0
        for held in trials:
            inside = [t for t in trials if t != held]
            if not inside:
                continue
            B, z = columns(library, wrench, [held])
            left = z - sparse(library, wrench, inside).predict(B)
            scores.append(1.0 - np.sum(left**2) / np.sum((z - z.mean()) ** 2))
            weights.append(len(z))
            nats += prior_cost(z, noise.wrench[i], noise) - prior_cost(left, noise.wrench[i], noise)
        r2[dof] = float(np.average(scores, weights=weights)) if scores else 0.0
        gain[dof] = nats
        terms[dof] = sparse(library, wrench, trials).terms
    return Description(r2, gain, terms, len(library))


def prior_cost(w: Array, deviation: float, noise: Noise) -> float:
    """w' K^-1 w / 2 of a first-order Gauss-Markov process (T,) with this stationary standard deviation."""
    decay = np.exp(-DT / noise.wrench_time)
    steps = (w[1:] - decay * w[:-1]) / np.sqrt(1.0 - decay**2)
    return 0.5 * float(w[0] ** 2 + np.sum(steps**2)) / deviation**2


def regressors(c: dict[str, Array]) -> dict[str, Array]:
    """Candidate terms: covariates, signed squares, products, place, what grows during a trial, induced drag."""
    base = {k: c[k] for k in ("surge_speed", "sway_speed", "yaw_rate", "rudder")}
    library = dict(base)
    library |= {f"{k} |{k}|": v * np.abs(v) for k, v in base.items()}
    keys = list(base)
    library |= {f"{a} {b}": base[a] * base[b] for i, a in enumerate(keys) for b in keys[i + 1 :]}
    library |= {"cos(heading)": np.cos(c["heading"]), "sin(heading)": np.sin(c["heading"])}
    library |= {"surge_speed^2": base["surge_speed"] ** 2, "x": c["x"], "y": c["y"]}
    library |= {"time": c["time"], "time surge_speed": c["time"] * base["surge_speed"]}
    library["surge_speed rudder^2"] = base["surge_speed"] * base["rudder"] ** 2
    library["surge_speed exp(-wall_distance/0.2 m)"] = base["surge_speed"] * np.exp(-c["wall_distance"] / 0.2)
    return library


def columns(library: dict[str, Array], y: Array, trials: list[int]) -> tuple[Array, Array]:
    """(regressors (N, R), force (N,)) of some trials, where everything is known."""
    A = np.stack([v[:, trials].ravel() for v in library.values()], axis=1)
    z = y[:, trials].ravel()
    good = np.isfinite(A).all(1) & np.isfinite(z)
    return A[good], z[good]


@dataclass(frozen=True)
class Law:
    """A fitted regression."""

    predict: Callable[[Array], Array]  # of regressors (N, R)
    terms: dict[str, float]  # regressor -> coefficient (SI)


def sparse(library: dict[str, Array], y: Array, trials: list[int]) -> Law:
    """Orthogonal matching pursuit on some trials (Pati, Rezaiifar and Krishnaprasad 1993)."""
    A, z = columns(library, y, trials)
    scale = A.std(axis=0) + 1e-12
    fitted = OrthogonalMatchingPursuit(n_nonzero_coefs=min(REGRESSORS, A.shape[1])).fit(A / scale, z)
    names = list(library)
    terms = {names[k]: float(fitted.coef_[k] / scale[k]) for k in np.flatnonzero(fitted.coef_)}
    return Law(lambda B: fitted.predict(B / scale), terms)
