"""Where the refitted nominal model misses force: degree of freedom, time, place, covariates."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from sklearn.linear_model import OrthogonalMatchingPursuit

from fish_sim.model import DT
from fish_sim.pool import LENGTH, WIDTH
from fish_train.identify.experiment import Experiment
from fish_train.identify.filter_types import Array, Noise
from fish_train.identify.fit import Fit, evaluate
from fish_train.identify.smoother import smooth

DOFS = ("surge", "sway", "yaw")
WINDOW = 2.0  # s, of the time shares
CELLS = (6, 3)  # of the pool's map
BINS = 6  # of a covariate
STRONGEST = 5  # windows and cells reported
REGRESSORS = 4  # of the sparse description


@dataclass(frozen=True)
class MissingForce:
    """Smoothed latent wrench of a fit with the covariates it may depend on; arrays (T, M), NaN beyond a trial's end."""

    names: tuple[str, ...]
    wrench: Array  # (T, M, 3) N, N, N m
    deviation: Array  # (T, M, 3)
    covariates: dict[str, Array]


def missing_force(fit: Fit, experiment: Experiment) -> MissingForce:
    """Smooth the latent wrench that a fit needs to reproduce the recordings."""
    fit = evaluate(fit.hypothesis, fit.theta, experiment, fit.noise, keep=True)
    xi, deviation = smooth(fit.result.history)
    nx, nq = xi.shape[2] - 6, fit.robot.links + 3
    valid = np.arange(len(xi))[:, None] < experiment.steps
    cos, sin = np.cos(xi[..., 2]), np.sin(xi[..., 2])
    memory = fit.result.history.memory[: len(xi)]
    covariates = {
        "surge_speed": xi[..., nq] * cos + xi[..., nq + 1] * sin,
        "sway_speed": xi[..., nq + 1] * cos - xi[..., nq] * sin,
        "yaw_rate": xi[..., nq + 2],
        "rudder": memory[..., 0],
        "rotor_speed": memory[..., 1],
        "wall_distance": np.minimum(LENGTH / 2 - np.abs(xi[..., 0]), WIDTH / 2 - np.abs(xi[..., 1])),
        "heading": np.arctan2(sin, cos),
        "time": np.where(valid, DT * np.arange(len(xi))[:, None], np.nan),
        "x": xi[..., 0],
        "y": xi[..., 1],
    }
    masked = {k: np.where(valid, v, np.nan) for k, v in covariates.items()}
    wrench = np.where(valid[..., None], xi[..., nx : nx + 3], np.nan)
    return MissingForce(experiment.names, wrench, deviation[..., nx : nx + 3], masked)


def dof_shares(nominal: Fit, final: Fit) -> dict[str, float]:
    """Share of each degree of freedom in the variance of the wrench that only the nominal model needs.

    The intensities stay one per equation (Kristensen, Madsen and Jorgensen 2004); they are compared in units of the
    final model's, since N and N m do not add up.
    """
    excess = np.maximum(np.square(np.array(nominal.noise.wrench) / np.array(final.noise.wrench)) - 1.0, 0.0)
    total = excess.sum()
    return {dof: float(e / total) if total > 0 else 0.0 for dof, e in zip(DOFS, excess, strict=True)}


def energy(force: MissingForce, scale: Array) -> Array:
    """(T, M) squared wrench in units of `scale` (3,), added over the degrees of freedom."""
    return np.sum(np.square(force.wrench / scale), axis=2)


def time_shares(force: MissingForce, scale: Array) -> list[dict[str, float | str]]:
    """The windows of 2 s that hold most of the missing force."""
    e, step = energy(force, scale), int(WINDOW / DT)
    total = np.nansum(e)
    rows = [
        {"trial": name, "from": k * DT, "to": min(k + step, len(e)) * DT, "share": float(np.nansum(e[k : k + step, m]) / total)}
        for m, name in enumerate(force.names)
        for k in range(0, len(e), step)
    ]  # fmt: skip
    return sorted(rows, key=lambda r: -r["share"])[:STRONGEST]


def place_shares(force: MissingForce, scale: Array) -> list[dict[str, object]]:
    """The cells of the pool's map with most of the missing force for the time spent there."""
    e, x, y = (a.ravel() for a in (energy(force, scale), force.covariates["x"], force.covariates["y"]))
    good = np.isfinite(e)
    edges = [
        np.linspace(-LENGTH / 2, LENGTH / 2, CELLS[0] + 1),
        np.linspace(-WIDTH / 2, WIDTH / 2, CELLS[1] + 1),
    ]
    total, _, _ = np.histogram2d(x[good], y[good], edges, weights=e[good])
    rows = [
        {"x": [float(edges[0][i]), float(edges[0][i + 1])], "y": [float(edges[1][j]), float(edges[1][j + 1])],
         "share": float(total[i, j] / total.sum())}
        for i in range(CELLS[0])
        for j in range(CELLS[1])
    ]  # fmt: skip
    return sorted(rows, key=lambda r: -r["share"])[:STRONGEST]


def covariate_shares(force: MissingForce, scale: Array) -> list[dict[str, object]]:
    """For every covariate, the contiguous range of quantile bins with above-average missing force."""
    e = energy(force, scale).ravel()
    rows = []
    for name, values in force.covariates.items():
        if name == "time":  # time_shares tells
            continue
        v = values.ravel()
        good = np.isfinite(e) & np.isfinite(v)
        if np.ptp(v[good]) < 1e-6:
            continue
        edges = np.quantile(v[good], np.linspace(0, 1, BINS + 1))
        index = np.clip(np.searchsorted(edges, v[good], side="right") - 1, 0, BINS - 1)
        share = np.bincount(index, e[good], BINS) / e[good].sum()
        low = high = int(np.argmax(share))
        while low > 0 and share[low - 1] > 1.0 / BINS:
            low -= 1
        while high < BINS - 1 and share[high + 1] > 1.0 / BINS:
            high += 1
        contrast = float(share.max() * BINS)
        rows.append({"name": name, "range": [float(edges[low]), float(edges[high + 1])],
                     "share": float(share[low : high + 1].sum()), "contrast": contrast})  # fmt: skip
    return sorted(rows, key=lambda r: -r["contrast"])[:STRONGEST]


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
    trials = np.arange(len(force.names))
    r2, gain, terms = {}, {}, {}
    for i, dof in enumerate(DOFS):
        wrench, scores, weights, nats = force.wrench[..., i], [], [], 0.0
        for held in trials:
            inside = [t for t in trials if t != held]
            if not inside:
                continue
            model, names, _, _ = _sparse(library, wrench, inside)
            B, z = _columns(library, wrench, [held])
            left = z - model(B)
            scores.append(1.0 - np.sum(left**2) / np.sum((z - z.mean()) ** 2))
            weights.append(len(z))
            nats += prior_cost(z, noise.wrench[i], noise) - prior_cost(left, noise.wrench[i], noise)
        r2[dof] = float(np.average(scores, weights=weights)) if scores else 0.0
        gain[dof] = nats
        _, names, coefficients, _ = _sparse(library, wrench, list(trials))
        terms[dof] = dict(zip(names, coefficients, strict=True))
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


def _columns(library: dict[str, Array], y: Array, trials: list[int]) -> tuple[Array, Array]:
    A = np.stack([v[:, trials].ravel() for v in library.values()], axis=1)
    z = y[:, trials].ravel()
    good = np.isfinite(A).all(1) & np.isfinite(z)
    return A[good], z[good]


def _sparse(library: dict[str, Array], y: Array, trials: list[int]):
    """(prediction function, names, coefficients, residual) of an orthogonal matching pursuit on some trials."""
    A, z = _columns(library, y, trials)
    scale = A.std(axis=0) + 1e-12
    fitted = OrthogonalMatchingPursuit(n_nonzero_coefs=min(REGRESSORS, A.shape[1])).fit(A / scale, z)
    chosen = np.flatnonzero(fitted.coef_)
    names = [list(library)[k] for k in chosen]
    coefficients = [float(fitted.coef_[k] / scale[k]) for k in chosen]
    return (lambda B: fitted.predict(B / scale)), names, coefficients, z
