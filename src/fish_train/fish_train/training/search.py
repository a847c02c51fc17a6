# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Gains without gradients: differential evolution of the same cost on the same paths, for comparison.

Every candidate swims the same episodes; meant for the few numbers of constants and schedules.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import OptimizeResult, differential_evolution

from fish_train.training.network import weight_count
from fish_train.training.trainer import Trainer

Array = NDArray[np.float64]
EPISODES = 3  # batches of fish that every candidate swims
POPULATION = 10  # candidates per number
GENERATIONS = {6: 40, 18: 20}  # by how many numbers are sought
REACH = 3.0  # of the numbers before tanh: gains to within 0.25 % of their range's ends


def search(trainer: Trainer, report: Callable[[str], None]) -> tuple[float, Array]:
    """(mean stage cost, flat weights) of the best candidate found."""
    bank = trainer.ladder_bank()
    batch_states = [trainer.draw_batch(bank) for _ in range(EPISODES)]
    noises = [
        trainer.draw_noise() for _ in batch_states
    ]  # the same for all candidates, like the states
    swims = list(zip(batch_states, noises, strict=True))
    count = weight_count(trainer.form.layers)

    def cost(weights: Array) -> float:
        value = float(
            np.mean([trainer.rollout_cost(weights, f.copy(), bank, noise) for f, noise in swims])
        )
        return value if np.isfinite(value) else 1e6

    def said(intermediate_result: OptimizeResult) -> None:
        report(
            f"generation {intermediate_result.nit}: mean stage cost {intermediate_result.fun:.5f}"
        )

    found = differential_evolution(
        cost,
        [(-REACH, REACH)] * count,
        x0=np.clip(
            trainer.weights, -REACH, REACH
        ),  # gains that start at an end of their range are beyond
        popsize=POPULATION,
        maxiter=GENERATIONS[count],
        tol=1e-4,
        polish=False,
        rng=np.random.default_rng(trainer.seed),
        callback=said,
    )
    return float(found.fun), found.x
