# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""`step` and `rollout` for torch tensors of any batch shape, differentiable in state, commands and parameters.

On the CPU in float64 the compiled kernels run inside one autograd node; on any other device or dtype the same
equations run as torch operations (`generic`).
"""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from torch import Tensor

from fish_sim.methods import METHODS
from fish_sim.model import DT, follow_command, motion_rate
from fish_sim.ops import torch_ops
from fish_sim.step import Stepper

XP = torch_ops()


class _Rollout(torch.autograd.Function):
    """states = rollout(start, commands, parameters) with the hand-written adjoint of the kernel."""

    @staticmethod
    def forward(
        ctx: Any, start: Tensor, commands: Tensor, parameters: Tensor, stepper: Stepper
    ) -> Tensor:
        values = [t.detach().numpy() for t in (start, commands, parameters)]
        states = torch.from_numpy(stepper.rollout(*values))
        ctx.stepper = stepper
        ctx.save_for_backward(states, commands, parameters, start)
        return states

    @staticmethod
    @torch.autograd.function.once_differentiable
    def backward(ctx: Any, grad: Tensor) -> tuple[Tensor | None, ...]:
        states, commands, parameters, start = ctx.saved_tensors
        values = [
            np.ascontiguousarray(t.detach().numpy()) for t in (states, commands, parameters, grad)
        ]
        gradients = [torch.from_numpy(g) for g in ctx.stepper.rollout_vjp(*values)]
        shapes = (start.shape, commands.shape, parameters.shape)
        return (*(g.sum_to_size(s) for g, s in zip(gradients, shapes, strict=True)), None)


def rollout(
    start: Tensor, commands: Tensor, parameters: Tensor, stepper: Stepper, generic: bool = False
) -> Tensor:
    """States (T + 1, ..., NS) from start (..., NS) under commands (T, ..., 2) and parameters (NP,) or (..., NP).

    Differentiable in all three. generic=True, another device or float32 runs the equations as torch operations.
    """
    if not generic and start.device.type == "cpu" and start.dtype == torch.float64:
        # numpy's, as the first call of torch's loads sympy, which takes seconds
        lead = np.broadcast_shapes(start.shape[:-1], commands.shape[1:-1], parameters.shape[:-1])
        states: Tensor = _Rollout.apply(start, _for_all(commands, lead), parameters, stepper)
        return states
    steps = [start]
    for command in commands:
        steps.append(_generic_step(steps[-1], command, parameters, stepper))
    return torch.stack(torch.broadcast_tensors(*steps))


def _for_all(commands: Tensor, lead: tuple[int, ...]) -> Tensor:
    """(T, ..., 2) as (T, *lead, 2); batch axes are added behind the time's, broadcasting would add them before."""
    times, *batch, width = commands.shape
    missing = len(lead) - len(batch)
    return commands.reshape(times, *[1] * missing, *batch, width).expand(times, *lead, width)


def step(
    state: Tensor, command: Tensor, parameters: Tensor, stepper: Stepper, generic: bool = False
) -> Tensor:
    """The state (..., NS) 10 ms later."""
    return rollout(state, command[None], parameters, stepper, generic)[1]


def _generic_step(state: Tensor, command: Tensor, parameters: Tensor, stepper: Stepper) -> Tensor:
    layout, scheme = stepper.layout, stepper.scheme
    method, h = METHODS[scheme.method], DT / scheme.substeps
    p = parameters.unbind(-1)
    moving = len(layout.motion)
    x, m0 = list(state[..., :moving].unbind(-1)), state[..., moving:].unbind(-1)
    m1 = follow_command(layout, m0, command.unbind(-1), p, DT, XP)
    for sub in range(scheme.substeps):
        K: list[list[Tensor]] = []
        for i, c in enumerate(method.C):
            fraction = (sub + c) / scheme.substeps
            drive = [
                v
                for a, b in zip(m0[:2], m1[:2], strict=True)
                for v in (a + (b - a) * fraction, (b - a) / DT)
            ]
            K.append(motion_rate(layout, _advance(x, K, method.A[i], h), drive, p, XP))
        x = _advance(x, K, method.B, h)
    return torch.stack(torch.broadcast_tensors(*x, *m1), dim=-1)


def _advance(
    x: list[Tensor], K: list[list[Tensor]], weights: tuple[float, ...], h: float
) -> list[Tensor]:
    used = [(h * a, k) for a, k in zip(weights, K, strict=False) if a != 0.0]
    return [value + sum(a * k[j] for a, k in used) for j, value in enumerate(x)]
