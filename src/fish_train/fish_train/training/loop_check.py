# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The compiled closed loop compared with torch's autograd on the same equations.

The reference's physics is the interpreted kernel with its own adjoint: nothing of it is compiled here.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from fish_control.paths import make_path
from fish_sim.self_check import heaviness, random_parameters, random_states, relative_error
from fish_sim.step import Stepper
from fish_train.training.batch_state import LONGEST_DELAY, BatchState, WindowResult
from fish_train.training.closed_loop_equations import (
    COST_NAMES,
    INPUT_COUNTS,
    SIZES,
    Law,
)
from fish_train.training.network import weight_count
from fish_train.training.path_bank import PathBank
from fish_train.training.torch_loop import TorchLoop

Array = NDArray[np.float64]

# of fewer no actuator falls behind its set-point again, and nothing travels back through its memory
PERIODS, HOLD = 6, 2
HIDDEN = 9  # units, one more than a panel of weights
SEED = 3
FLEET = ("plant", "memory", "place", "history")


class Loop(Protocol):
    """What both forms of the loop can do."""

    def window(
        self,
        weights: Array,
        batch_state: BatchState,
        steps: int,
        cost: Array,
        noise: Array | None,
        gradient: bool,
        hold: int,
    ) -> WindowResult: ...


def loop_errors(
    stepper: Stepper, law: Law, width: int, make: Callable[[PathBank, tuple[int, ...]], Loop]
) -> dict[str, float]:
    """Largest relative errors of a window with gradient; `make` wraps the library that is checked.

    One fish more than a vector holds, on a closed and an open path; what they see is late and noisy.
    """
    random = np.random.default_rng(SEED)
    bank = PathBank(
        [make_path("circle", radius=0.8), make_path("straight", length=3.0)], law.tracker
    )
    layers = (INPUT_COUNTS[law.inputs], HIDDEN, SIZES["gains"])
    slow = TorchLoop(
        Stepper(stepper.layout.structure, stepper.scheme, compiled=False), law, bank, layers
    )
    weights = 0.3 * random.standard_normal(weight_count(layers))
    cost, noise = (
        np.full(len(COST_NAMES), 0.5),
        1e-3 * random.standard_normal((PERIODS + 1, width + 1, 6)),
    )
    batch_state = _batch_state(stepper, bank, width + 1, random)
    batch_states = [batch_state.copy(), batch_state.copy()]
    right, found = (
        loop.window(weights, batch_state, PERIODS, cost, noise, True, HOLD)
        for loop, batch_state in zip((slow, make(bank, layers)), batch_states, strict=True)
    )
    assert right.gradient is not None
    assert found.gradient is not None
    errors = {"cost": abs(found.cost / right.cost - 1.0)}
    errors["gradient"] = relative_error(found.gradient[:, None], right.gradient[:, None])
    errors |= {
        name: relative_error(getattr(found, name), getattr(right, name))
        for name in ("report", "applied")
    }
    errors |= {
        name: relative_error(
            *(getattr(batch_state, name) for batch_state in reversed(batch_states))
        )
        for name in FLEET
    }
    return errors


def _batch_state(
    stepper: Stepper, bank: PathBank, batch: int, random: np.random.Generator
) -> BatchState:
    """Fish beside their paths, in motion."""
    layout = stepper.layout
    path = np.arange(batch) % len(bank)
    poses = np.array([[*bank.paths[k].point(0.3), bank.paths[k].heading_at(0.3)] for k in path])
    poses += random.normal(0.0, [0.02, 0.02, 0.1], (batch, 3))
    plant = random_states(layout, (batch,), random)
    plant[:, 3 : layout.links + 3] += poses[:, 2:] - plant[:, 2:3]
    plant[:, :3] = poses
    seen = np.column_stack([poses, random.uniform(-0.1, 0.2, (batch, 3))])
    delay = np.arange(batch) % (LONGEST_DELAY + 1)
    parameters = random_parameters(layout, batch, random)
    parameters *= heaviness(layout, stepper.scheme, parameters)
    batch_state = BatchState.at(
        plant, parameters, path, random.uniform(0.1, 0.3, batch), seen, delay
    )
    batch_state.place[:, [0, 2]] = 0.3
    return batch_state
