# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The closed loop as torch operations: slow, for machines without a C compiler, and the check of the compiled one.

The same equations (`loop`), differentiated by torch's autograd instead of by hand; physics through fish_sim.torch_step. The
check compares with the interpreted kernel and its own adjoint: nothing of the reference is compiled here.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from fish_control.paths import make_path
from fish_sim import torch_step
from fish_sim.ops import torch_ops
from fish_sim.self_check import heaviness, random_parameters, random_states, relative_error
from fish_sim.step import Stepper
from fish_train.training.batch import (
    HISTORY,
    LONGEST_DELAY,
    BatchState,
    PathBank,
    WindowResult,
    check_hold,
    locate,
)
from fish_train.training.closed_loop_equations import (
    COST_NAMES,
    INPUT_COUNTS,
    PHYSICS_STEPS,
    SIZES,
    Law,
    act,
    drive,
    motion,
    sense,
)
from fish_train.training.network import LAYERS, split, weight_count

Array = NDArray[np.float64]
XP = torch_ops()
# of fewer no actuator falls behind its set-point again, and nothing travels back through its memory
PERIODS, HOLD = 6, 2
HIDDEN = 9  # units, one more than a panel of weights
SEED = 3
FLEET = ("plant", "memory", "place", "history")


class TorchLoop:
    """Windows of the closed loop; the same calls and numbers as `CompiledLoop`."""

    def __init__(
        self, stepper: Stepper, law: Law, bank: PathBank, layers: tuple[int, ...] = LAYERS
    ) -> None:
        self.stepper, self.law, self.layers = stepper, law, layers
        self.set_bank(bank)

    def set_bank(self, bank: PathBank) -> None:
        """Follow other paths from now on."""
        self.bank = bank

    def window(
        self,
        weights: Array,
        batch_state: BatchState,
        steps: int,
        cost: Array,
        noise: Array | None = None,
        gradient: bool = True,
        hold: int = 1,
    ) -> WindowResult:
        """Run `steps` periods from this state of the batch, which is advanced in place; see `CompiledLoop.window`."""
        check_hold(steps, hold)
        flat = torch.tensor(weights, requires_grad=gradient)
        noise = np.zeros((steps + 1, len(batch_state), SIZES["motion"])) if noise is None else noise
        run = _Window(
            self, flat, batch_state, torch.from_numpy(np.asarray(noise)), tuple(map(float, cost))
        )
        with torch.set_grad_enabled(gradient):
            total, reports, applied = torch.zeros(()), [], []
            for t in range(steps):
                sensed = run.look(t)
                total = total + (sensed["cost"][0].sum() if t else 0.0)
                reports.append(_stack(sensed["report"]))
                if t % hold == 0:
                    run.decide(sensed)
                total = total + run.advance(sensed)
                applied.append(_stack(run.last))
            kept = batch_state.place.copy()
            sensed = run.look(steps)
            batch_state.place[:] = kept  # the next window looks again at its first period
            reports.append(_stack(sensed["report"]))
            mean = (total + sensed["cost"][0].sum()) / (len(batch_state) * steps)
        found = torch.autograd.grad(mean, flat)[0].numpy() if gradient else None
        run.store()
        report, moved = (torch.stack(rows).detach().numpy() for rows in (reports, applied))
        return WindowResult(float(mean.detach()), found, report, moved)

    def find(self, batch_state: BatchState, which: int, position: Tensor) -> list[Tensor]:
        """Geometry of every fish on its path; `which` place (0 seen, 1 true) moves on."""
        geometry = [
            locate(self.bank.tables[k], self.law.tracker, place[2 * which : 2 * which + 2], xy)
            for k, place, xy in zip(
                batch_state.path, batch_state.place, position.detach().numpy(), strict=True
            )
        ]
        return list(torch.from_numpy(np.array(geometry)).unbind(-1))


class _Window:
    """The state of one window, as lists of (B,) tensors."""

    def __init__(
        self,
        loop: TorchLoop,
        flat: Tensor,
        batch_state: BatchState,
        noise: Tensor,
        cost: tuple[float, ...],
    ) -> None:
        self._loop, self._batch_state, self._noise, self._cost = loop, batch_state, noise, cost
        self._weights = split(flat, loop.layers)
        self._plant = torch.from_numpy(batch_state.plant.copy())
        self._parameters, self._speed = (
            torch.from_numpy(a) for a in (batch_state.parameters, batch_state.speed)
        )
        memory = list(torch.from_numpy(batch_state.memory.copy()).unbind(-1))
        cuts = np.cumsum([SIZES[k] for k in ("guidance", "control", "actuator")])
        self._guidance, self._control = memory[: cuts[0]], memory[cuts[0] : cuts[1]]
        self._actuator, self.last = memory[cuts[1] : cuts[2]], memory[cuts[2] :]
        self._motions = [*torch.from_numpy(batch_state.history.copy()).unbind(1), self._motion()]

    def _motion(self) -> Tensor:
        s, size = self._plant.unbind(-1), self._loop.stepper.layout.links + 3
        return _stack(motion(s[:3], s[size : size + 3], XP))

    def look(self, t: int) -> dict[str, list[Tensor]]:
        """Sense at the start of period t of the window."""
        batch_state, true = self._batch_state, self._motions[-1]
        newest = HISTORY + PHYSICS_STEPS * t - batch_state.delay
        seen = [
            torch.stack([self._motions[at - back][b] for b, at in enumerate(newest)])
            + self._noise[t]
            for back in reversed(range(PHYSICS_STEPS))
        ]
        near, real = (
            self._loop.find(batch_state, k, o[:, :2]) for k, o in enumerate((seen[-1], true))
        )
        setpoint = self.last[SIZES["gains"] :]
        rows = (
            torch.cat(seen, dim=-1).unbind(-1),
            true.unbind(-1),
            self._guidance,
            setpoint,
            near,
            real,
        )
        return sense(*rows, self._speed, self._cost, self._loop.law, XP)

    def decide(self, sensed: dict[str, list[Tensor]]) -> None:
        """Ask the policy."""
        inputs = (
            _stack(sensed["inputs"])
            if sensed["inputs"]
            else self._plant.new_zeros(len(self._plant), 0)
        )
        self._raw = self._policy(inputs).unbind(-1)

    def advance(self, sensed: dict[str, list[Tensor]]) -> Tensor:
        """Control law and physics of one period; the summed cost of gains and set-points."""
        law = self._loop.law
        acted = act(sensed["errors"], self._control, self.last, self._raw, self._cost, law, XP)
        self._guidance, self._control, self.last = (
            sensed["guidance"],
            acted["control"],
            acted["last"],
        )
        for _ in range(PHYSICS_STEPS):
            self._actuator, command = drive(self._actuator, self.last[SIZES["gains"] :], law, XP)
            self._plant = torch_step.step(
                self._plant, _stack(command), self._parameters, self._loop.stepper
            )
            self._motions.append(self._motion())
        cost: Tensor = acted["cost"][0].sum()
        return cost

    def _policy(self, x: Tensor) -> Tensor:
        """(B, inputs) -> (B, 6) before tanh."""
        for W, b in self._weights[:-1]:
            x = torch.relu(x @ W.T + b)
        W, b = self._weights[-1]
        raw: Tensor = x @ W.T + b
        return raw

    def store(self) -> None:
        """Write the state back."""
        memory = [*self._guidance, *self._control, *self._actuator, *self.last]
        like = self._speed
        columns = [m if isinstance(m, Tensor) else torch.full_like(like, m) for m in memory]
        self._batch_state.plant[:] = self._plant.detach().numpy()
        self._batch_state.memory[:] = torch.stack(columns, dim=-1).detach().numpy()
        self._batch_state.history[:] = (
            torch.stack(self._motions[-1 - HISTORY : -1], dim=1).detach().numpy()
        )


def _stack(values: list[Tensor]) -> Tensor:
    same_shape: list[Tensor] = torch.broadcast_tensors(*values)  # type: ignore[no-untyped-call]
    return torch.stack(same_shape, dim=-1)


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
