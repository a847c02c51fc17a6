# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What an effect that was found does to the fish, and where: in which intervals of time, over which range of a covariate."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from fish_sim.effects.effect import Effect
from fish_sim.model import DT
from fish_sysid.dataset.experiment import Experiment
from fish_sysid.diagnosis.latent_force import (
    MissingForce,
    energy,
    located,
    smoothed,
)
from fish_sysid.estimation.ekf_types import WRENCH, Array, drive_at
from fish_sysid.estimation.map_fit import Fit
from fish_sysid.estimation.parametrization import AnyEffect

STROKE = 50  # grid points of 10 ms: a force that swings with the tail acts all the while
LARGE = 0.99  # quantile of the force that counts as its size
ACTIVE = 0.3  # of that size, from which an effect counts as acting
EDGES = 25  # of the quantile bins among which a range is sought
COVARIATES = 5  # reported


def pushes(effect: AnyEffect) -> bool:
    """Whether an effect pushes the fish: through a wrench on its bodies or the water's motion."""
    if not issubclass(effect, Effect):
        return False
    return effect.wrench is not Effect.wrench or effect.water is not Effect.water


def effect_wrench(fit: Fit, name: str, experiment: Experiment) -> MissingForce:
    """The push of an effect (see `pushes`) of a fit along the smoothed motion, as a wrench W on the head.

    B W = q''(effect) - q''(no effect), rows of the head; B = d q'' / d wrench. Nothing of the water's noise is in it. Without
    the effect all its parameters are neutral: the mean of a flow, which is no strength of its own, pushes as well.
    """
    xi, _, memory = smoothed(fit, experiment)
    stepper, nq = fit.hypothesis.parametrization.stepper, fit.robot.links + 3
    neutral = {k: own.value for k, own in fit.hypothesis.effect(name).parameters.items()}
    p = stepper.parameters(fit.robot)
    p_without = stepper.parameters(fit.robot.with_effect(name, **neutral))
    motion = np.nan_to_num(xi[..., :-6].reshape(-1, xi.shape[2] - 6))
    drive = drive_at(memory[:-1, :, :2], memory[1:, :, :2], 0.0).reshape(-1, 4)
    still = (np.zeros_like(motion), np.zeros_like(drive))
    head = slice(nq, nq + 3)
    axes = np.eye(len(p))[[stepper.layout.parameters.index(axis) for axis in WRENCH]]
    pushed = [stepper.rates_jvp(motion, drive, p, *still, axis) for axis in axes]
    B = np.stack([tangent[:, head] for _, tangent in pushed], axis=2)
    bare, _ = stepper.rates_jvp(motion, drive, p_without, *still, axes[0])
    difference = (pushed[0][0] - bare)[:, head, None]
    wrench = np.asarray(np.linalg.solve(B, difference), dtype=np.float64).reshape(*xi.shape[:2], 3)
    return located(fit, experiment, xi, memory, wrench, np.zeros_like(wrench))


def size(force: MissingForce, scale: Array) -> Array:
    """(T, M) root mean square of a force over a stroke, in units of `scale` (3,); NaN beyond a trial's end."""
    squared = energy(force, scale)
    mean: Array = uniform_filter1d(np.nan_to_num(squared), STROKE, axis=0, mode="nearest")
    return np.where(np.isfinite(squared), np.sqrt(np.maximum(mean, 0.0)), np.nan)


def acting(force: MissingForce, scale: Array) -> NDArray[np.bool_]:
    """(T, M) when a force is above ACTIVE of what it is at its strongest."""
    s = size(force, scale)
    return np.nan_to_num(s) > ACTIVE * float(np.nanquantile(s, LARGE))


def intervals(force: MissingForce, scale: Array) -> list[dict[str, Any]]:
    """When an effect acts, interval by interval, with their shares of its impulse in units of `scale` (3,); the largest first."""
    acts, s = acting(force, scale), np.nan_to_num(size(force, scale))
    rows: list[dict[str, Any]] = []
    for m, name in enumerate(force.names):
        edges = np.flatnonzero(np.diff(np.concatenate([[False], acts[:, m], [False]]).astype(int)))
        rows += [
            {"trial": name, "from": a * DT, "to": b * DT, "share": float(s[a:b, m].sum() / s.sum())}
            for a, b in edges.reshape(-1, 2).tolist()
        ]
    return sorted(rows, key=lambda r: -r["share"])


def regimes(force: MissingForce, scale: Array) -> list[dict[str, Any]]:
    """Of every covariate the range that predicts best when an effect acts, by its F1; the best first. scale: as in `size`."""
    acts, s = acting(force, scale).ravel(), size(force, scale).ravel()
    rows: list[dict[str, Any]] = []
    for name, values in force.covariates.items():
        v = values.ravel()
        good = np.isfinite(s) & np.isfinite(v)
        if name == "time" or np.ptp(v[good]) < 1e-6:  # of time, see intervals
            continue
        edges = np.unique(np.quantile(v[good], np.linspace(0.0, 1.0, EDGES)))
        score, low, high = max(
            (f1((v >= low) & (v <= high) & good, acts), low, high)
            for i, low in enumerate(edges[:-1].tolist())
            for high in edges[i + 1 :].tolist()
        )
        inside = (v >= low) & (v <= high) & good
        share = float(s[inside].sum() / s[good].sum())
        rows.append({"name": name, "range": [low, high], "share": share, "f1": score})
    return sorted(rows, key=lambda r: -r["f1"])[:COVARIATES]


def f1(stated: NDArray[np.bool_], true: NDArray[np.bool_]) -> float:
    """Harmonic mean of precision and recall of samples (N,)."""
    return 2.0 * float((stated & true).sum()) / max(float(stated.sum() + true.sum()), 1.0)
