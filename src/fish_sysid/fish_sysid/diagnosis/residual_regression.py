# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Residual regression: a law for the force that a model leaves, of the few terms that lower the cost most.

The force is written as an effect with a free coefficient for every term on every degree of freedom, so that one pass of the
filter gives the derivative of every innovation with respect to every coefficient. It is linear in its coefficients, so that the
cost is quadratic in them (see `cross_validation`): terms are chosen one after the other, each with all parameters refitted, and
judged on trials that they were not chosen on.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any

import numpy as np

from fish_node.pool import LENGTH, WIDTH
from fish_sim.effects.effect import BodyMotion, Drive, Effect, Values, Wrench
from fish_sim.ops import NUMPY, Scalar
from fish_sim.parameter import Parameter
from fish_sysid.dataset.experiment import Experiment
from fish_sysid.diagnosis.cross_validation import Quadratic, quadratic
from fish_sysid.diagnosis.latent_force import DOFS
from fish_sysid.diagnosis.significance import Level
from fish_sysid.estimation.ekf_types import Array, Noise
from fish_sysid.estimation.map_fit import Fit, evaluate
from fish_sysid.estimation.parametrization import Hypothesis
from fish_sysid.estimation.thresholds import MOST_TERMS, SMALLEST_TERM

WALL = 0.2  # m, the wall's influence decays by e over it
FREE = 1e6  # bounds of a coefficient: none


def regressors(body: BodyMotion, time: Scalar, drive: Drive, xp: Any) -> dict[str, Scalar]:
    """Terms of a law in SI units: motion and inputs, signed squares, products, heading and place, what grows during a trial."""
    base = {
        "surge_speed": body.u,
        "sway_speed": body.v,
        "yaw_rate": body.w,
        "rudder": drive.alpha,
        "rotor_speed": drive.rotor_speed,
    }
    terms = dict(base)
    terms |= {f"{k} |{k}|": v * xp.fabs(v) for k, v in base.items()}
    terms |= {f"{a} {b}": base[a] * base[b] for a, b in combinations(base, 2)}
    terms |= {"cos(heading)": body.cos, "sin(heading)": body.sin}
    terms |= {"x": body.x, "y": body.y, "time": time}
    terms |= {f"time {k}": time * base[k] for k in ("surge_speed", "sway_speed", "yaw_rate")}
    terms["surge_speed rudder^2"] = body.u * drive.alpha * drive.alpha
    gap = xp.fmin(LENGTH / 2 - xp.fabs(body.x), WIDTH / 2 - xp.fabs(body.y))
    terms[f"surge_speed exp(-wall_distance/{WALL} m)"] = body.u * xp.exp(-gap / WALL)
    return terms


TERMS = tuple(regressors(BodyMotion("head", *[1.0] * 10), 1.0, Drive(*[1.0] * 4), NUMPY))
COEFFICIENTS = tuple(f"{dof}_{j}" for dof in DOFS for j in range(len(TERMS)))


class FreeForce(Effect):
    """(X, Y, N)_i = sum_j c_ij term_j on the head, term_j of `regressors`; t [s] since the start of the trial is a state.

    No candidate: a name says more than a list of coefficients.
    """

    name = "free_force"
    kind = "physics"
    equation = "(X, Y, N)_i = sum_j c_ij term_j on the head"
    source = "a linear combination of what a force may depend on"
    parameters = dict.fromkeys(COEFFICIENTS, Parameter(0.0, "SI", -FREE, FREE))
    strength = COEFFICIENTS
    states = ("time",)

    @staticmethod
    def wrench(p: Values, body: BodyMotion, z: Values, drive: Drive, xp: Any) -> Wrench | None:
        if body.name != "head":
            return None
        terms = list(regressors(body, z.time, drive, xp).values())
        x, y, n = (
            sum(getattr(p, f"{dof}_{j}") * term for j, term in enumerate(terms)) for dof in DOFS
        )
        return x, y, n

    @staticmethod
    def derivative(p: Values, z: Values, slip: Scalar, drive: Drive, xp: Any) -> tuple[Scalar, ...]:
        return (1.0,)


@dataclass(frozen=True)
class Law:
    """A sparse law of the missing wrench, by degree of freedom."""

    gain: dict[str, float]  # nats that the law gains as a force, cross-validated
    terms: dict[str, dict[str, float]]  # term -> coefficient (SI)
    samples: float  # scalar measurements

    def lawful(self, level: Level) -> list[str]:
        """Degrees of freedom on which the law gains more on unseen trials than by chance, the most lawful first."""
        needed = level.needed_unseen(self.samples, len(self.gain))
        found = [dof for dof, gain in self.gain.items() if gain > needed]
        return sorted(found, key=lambda dof: -self.gain[dof])


def residual_law(fit: Fit, experiment: Experiment) -> Law:
    """The law of at most MOST_TERMS terms per degree of freedom that a fit leaves on the trials it was fitted to."""
    robot = fit.hypothesis.robot
    robot = replace(robot, table={**robot.table, FreeForce.name: FreeForce})
    hypothesis = replace(fit.hypothesis, robot=robot).with_effect(FreeForce.name)
    theta = np.concatenate([fit.theta, np.zeros(len(COEFFICIENTS))])
    gradients, normals = costs(hypothesis, theta, experiment, fit.noise)
    prior = fit.hypothesis.parametrization.prior
    whole = quadratic(gradients, normals, fit.theta, prior)
    gains, terms = {}, {}
    for i, dof in enumerate(DOFS):
        first = len(fit.theta) + i * len(TERMS)
        offered = range(first, first + len(TERMS))
        chosen = choose_terms(whole, offered)
        step = whole.best_step(chosen)
        terms[dof] = {TERMS[j - first]: float(step[j]) for j in chosen}
        gains[dof] = cross_validated(gradients, normals, fit.theta, prior, offered)
    return Law(gains, terms, fit.samples)


def costs(
    hypothesis: Hypothesis, theta: Array, experiment: Experiment, noise: Noise
) -> tuple[Array, Array]:
    """Gradient (M, K) and Gauss-Newton matrix (M, K, K) of every trial's -log likelihood at theta (K,)."""
    results = (
        evaluate(hypothesis, theta, experiment.select(part), noise).result
        for part in experiment.batches()
    )
    gradients, normals = zip(*((result.gradient, result.normal) for result in results), strict=True)
    return np.concatenate(gradients), np.concatenate(normals)


def choose_terms(cost: Quadratic, offered: Sequence[int]) -> list[int]:
    """The terms that lower the cost most, one after the other while one is worth it, each with all parameters refitted."""
    chosen: list[int] = []
    left = {j for j in offered if cost.information[j, j] > 0.0}
    reached = cost.cost(cost.best_step([]))
    while left and len(chosen) < MOST_TERMS:
        reach = {j: cost.cost(cost.best_step([*chosen, j])) for j in sorted(left)}
        best = min(reach, key=reach.__getitem__)
        if reached - reach[best] < SMALLEST_TERM:
            break
        chosen.append(best)
        left.remove(best)
        reached = reach[best]
    return chosen


def cross_validated(
    gradients: Array, normals: Array, theta: Array, prior: Array, offered: Sequence[int]
) -> float:
    """Nats that laws chosen on the other trials gain on each trial, against the parameters refitted there without one."""
    gain, trials = 0.0, np.arange(len(gradients))
    for held in trials if len(trials) > 1 else []:
        others = quadratic(gradients[trials != held], normals[trials != held], theta, prior)
        unseen = Quadratic(gradients[held], normals[held], len(theta))
        without, law = others.best_step([]), others.best_step(choose_terms(others, offered))
        gain += unseen.cost(without) - unseen.cost(law)
    return gain
