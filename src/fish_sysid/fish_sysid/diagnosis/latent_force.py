# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Where the refitted nominal model misses force: degree of freedom, time, place, covariates."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from fish_node.pool import LENGTH, WIDTH
from fish_sim.model import DT
from fish_sysid.dataset.experiment import Experiment
from fish_sysid.dataset.grid import in_base_link
from fish_sysid.estimation.ekf_types import Array
from fish_sysid.estimation.map_fit import Fit, evaluate
from fish_sysid.estimation.smoother import smooth

DOFS = ("surge", "sway", "yaw")
WINDOW = 2.0  # s, of the time shares
CELLS = (6, 3)  # of the pool's map
BINS = 6  # of a covariate
STRONGEST = 5  # windows and cells reported


@dataclass(frozen=True)
class MissingForce:
    """Wrench on the head with the covariates it may depend on; arrays (T, M), NaN beyond a trial's end."""

    names: tuple[str, ...]
    wrench: Array  # (T, M, 3) N, N, N m
    deviation: Array  # (T, M, 3)
    covariates: dict[str, Array]


def missing_force(fit: Fit, experiment: Experiment) -> MissingForce:
    """Smooth the latent wrench that a fit needs to reproduce the recordings."""
    xi, deviation, memory = smoothed(fit, experiment)
    wrench = slice(xi.shape[2] - 6, xi.shape[2] - 3)
    return located(fit, experiment, xi, memory, xi[..., wrench], deviation[..., wrench])


def smoothed(fit: Fit, experiment: Experiment) -> tuple[Array, Array, Array]:
    """State (T, M, N), its standard deviations, and memory (T + 1, M, NM) given all measurements; 0 beyond a trial's end."""
    layout = fit.hypothesis.parametrization.stepper.layout
    T, M = experiment.length, len(experiment.names)
    xi, deviation = np.zeros((2, T, M, len(layout.motion) + 6))
    memory = np.zeros((T + 1, M, len(layout.memory)))
    for part in experiment.batches():
        some = experiment.select(part)
        history = evaluate(fit.hypothesis, fit.theta, some, fit.noise, keep=True).result.history
        assert history is not None  # kept
        xi[: some.length, part], deviation[: some.length, part] = smooth(history)
        memory[: some.length + 1, part] = history.memory
    return xi, deviation, memory


def located(
    fit: Fit, experiment: Experiment, xi: Array, memory: Array, wrench: Array, deviation: Array
) -> MissingForce:
    """A wrench (T, M, 3) with what it may depend on."""
    nq = fit.robot.links + 3
    valid = np.arange(len(xi))[:, None] < experiment.steps
    psi = xi[..., 2]
    surge, sway = in_base_link(xi[..., nq], xi[..., nq + 1], psi)
    covariates = {
        "surge_speed": surge,
        "sway_speed": sway,
        "yaw_rate": xi[..., nq + 2],
        "rudder": memory[: len(xi), :, 0],
        "rotor_speed": memory[: len(xi), :, 1],
        "wall_distance": np.minimum(
            LENGTH / 2 - np.abs(xi[..., 0]), WIDTH / 2 - np.abs(xi[..., 1])
        ),
        "heading": np.arctan2(np.sin(psi), np.cos(psi)),
        "time": np.where(valid, DT * np.arange(len(xi))[:, None], np.nan),
        "x": xi[..., 0],
        "y": xi[..., 1],
    }
    masked = {k: np.where(valid, v, np.nan) for k, v in covariates.items()}
    force = np.where(valid[..., None], wrench, np.nan)
    return MissingForce(experiment.names, force, deviation, masked)


def dof_shares(nominal: Fit, final: Fit) -> dict[str, float]:
    """Share of each degree of freedom in the variance of the wrench that only the nominal model needs.

    The intensities stay one per equation (Kristensen, Madsen and Jorgensen 2004); they are compared in units of the
    final model's, since N and N m do not add up.
    """
    ratio = np.square(np.array(nominal.noise.wrench) / np.array(final.noise.wrench))
    removed = np.maximum(ratio - 1.0, 0.0)
    shares = removed / removed.sum() if removed.any() else removed
    return dict(zip(DOFS, shares.tolist(), strict=True))


def energy(force: MissingForce, scale: Array) -> Array:
    """(T, M) squared wrench in units of `scale` (3,), added over the degrees of freedom."""
    squared: Array = np.sum(np.square(force.wrench / scale), axis=2)
    return squared


def time_shares(force: MissingForce, scale: Array) -> list[dict[str, Any]]:
    """The windows of 2 s that hold most of the missing force, in units of `scale` (3,); the last one of a trial ends with it."""
    e, step = energy(force, scale), int(WINDOW / DT)
    total, lengths = np.nansum(e), np.isfinite(e).sum(axis=0)
    rows: list[dict[str, Any]] = [
        {
            "trial": name,
            "from": k * DT,
            "to": min(k + step, length) * DT,
            "share": float(np.nansum(e[k : k + step, m]) / total),
        }
        for m, (name, length) in enumerate(zip(force.names, lengths.tolist(), strict=True))
        for k in range(0, length, step)
    ]
    return sorted(rows, key=lambda r: -r["share"])[:STRONGEST]


def place_shares(force: MissingForce, scale: Array) -> list[dict[str, Any]]:
    """The cells of the pool's map with most of the missing force, in units of `scale` (3,); none where it acts beyond the map."""
    e, x, y = (
        a.ravel() for a in (energy(force, scale), force.covariates["x"], force.covariates["y"])
    )
    good = np.isfinite(e)
    edges = [
        np.linspace(-LENGTH / 2, LENGTH / 2, CELLS[0] + 1),
        np.linspace(-WIDTH / 2, WIDTH / 2, CELLS[1] + 1),
    ]
    total, _, _ = np.histogram2d(x[good], y[good], edges, weights=e[good])
    if not total.any():
        return []
    rows: list[dict[str, Any]] = [
        {
            "x": [float(edges[0][i]), float(edges[0][i + 1])],
            "y": [float(edges[1][j]), float(edges[1][j + 1])],
            "share": float(total[i, j] / total.sum()),
        }
        for i in range(CELLS[0])
        for j in range(CELLS[1])
    ]
    return sorted(rows, key=lambda r: -r["share"])[:STRONGEST]


def covariate_shares(force: MissingForce, scale: Array) -> list[dict[str, Any]]:
    """For every covariate, the contiguous range of quantile bins in which the missing force is denser than on average.

    scale (3,): units in which the force is added over the degrees of freedom.
    contrast: the densest bin's share of the force over its share of the samples. A covariate that rests at a value, as a rudder
    does, has fewer bins, and one of many samples.
    """
    e = energy(force, scale).ravel()
    rows: list[dict[str, Any]] = []
    for name, values in force.covariates.items():
        if name == "time":  # see time_shares
            continue
        v = values.ravel()
        good = np.isfinite(e) & np.isfinite(v)
        if np.ptp(v[good]) < 1e-6:
            continue
        edges = np.unique(np.quantile(v[good], np.linspace(0, 1, BINS + 1)))
        bins = len(edges) - 1
        index = np.clip(np.searchsorted(edges, v[good], side="right") - 1, 0, bins - 1)
        share = np.bincount(index, e[good], bins) / e[good].sum()
        dense = share * len(index) / np.maximum(np.bincount(index, minlength=bins), 1)
        low = high = int(np.argmax(dense))
        while low > 0 and dense[low - 1] > 1.0:
            low -= 1
        while high < bins - 1 and dense[high + 1] > 1.0:
            high += 1
        rows.append(
            {
                "name": name,
                "range": [float(edges[low]), float(edges[high + 1])],
                "share": float(share[low : high + 1].sum()),
                "contrast": float(dense.max()),
            }
        )
    return sorted(rows, key=lambda r: -r["contrast"])[:STRONGEST]
