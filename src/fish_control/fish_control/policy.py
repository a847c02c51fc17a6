# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Gains from the robot's situation: a small network, or constants; numpy only."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fish_control.control_law import Gains
from fish_control.policy_spec import INPUTS, Input, PolicySpec

Array = NDArray[np.float64]


def policy_inputs(
    head_angle: Any,
    surge_speed: Any,
    desired_speed: Any,
    heading_error: Any,
    speed_error: Any,
    cross_track_error: Any,
    xp: Any,
    inputs: tuple[Input, ...] = INPUTS,
) -> list[Any]:
    """The policy's inputs in the paper's order, normalised as (value - offset) / scale; generic scalars.

    Args:
        head_angle: mean heading over the stroke [rad], any number of turns. Speeds [m/s], errors [rad, m/s,
            m].
    """
    wrapped = xp.arctan2(xp.sin(head_angle), xp.cos(head_angle))
    values = (wrapped, surge_speed, desired_speed, heading_error, speed_error, cross_track_error)
    return [(value - i.offset) / i.scale for value, i in zip(values, inputs, strict=True)]


def tensor_shapes(contract: PolicySpec) -> dict[str, tuple[int, ...]]:
    """Names and shapes of the arrays a file must hold: `layers.K.weight` (out, in), `layers.K.bias`, or
    `gains`.
    """
    if not contract.layers:
        return {"gains": (len(contract.outputs),)}
    shapes: dict[str, tuple[int, ...]] = {}
    for k, (size_in, size_out) in enumerate(
        zip(contract.layers[:-1], contract.layers[1:], strict=True)
    ):
        shapes[f"layers.{k}.weight"] = (size_out, size_in)
        shapes[f"layers.{k}.bias"] = (size_out,)
    return shapes


class Policy:
    """Weights and their contract; `gains` is all a controller needs."""

    def __init__(self, contract: PolicySpec, tensors: Mapping[str, ArrayLike]) -> None:
        self.contract = contract
        self.tensors = {
            name: np.asarray(tensor, dtype=np.float64) for name, tensor in tensors.items()
        }
        self._low = np.array([o.low for o in contract.outputs])
        self._span = np.array([o.high - o.low for o in contract.outputs])

    @classmethod
    def constant(cls, gains: Gains, contract: PolicySpec | None = None) -> Policy:
        """The same gains always."""
        return cls(contract or PolicySpec(layers=()), {"gains": np.array(gains)})

    @cached_property
    def _layers(self) -> list[tuple[Array, Array]]:
        """Weights (in, out) and biases."""
        count = len(self.contract.layers) - 1
        return [
            (self.tensors[f"layers.{k}.weight"].T.copy(), self.tensors[f"layers.{k}.bias"])
            for k in range(count)
        ]

    def gains(self, inputs: ArrayLike) -> Gains:
        """Gains for normalised inputs (..., 6); each of the six with the leading shape.

        x = relu(W x + b) through the hidden layers, gain = low + (high - low) (tanh(W x + b) + 1) / 2
        """
        x = np.asarray(inputs, dtype=np.float64)
        if not self.contract.layers:
            values = np.broadcast_to(self.tensors["gains"], (*x.shape[:-1], len(self._low)))
            return Gains(*np.moveaxis(values, -1, 0))
        *hidden, (weight, bias) = self._layers
        for W, b in hidden:
            x = np.maximum(x @ W + b, 0.0)
        values = self._low + self._span * 0.5 * (np.tanh(x @ weight + bias) + 1.0)
        return Gains(*(values if values.ndim == 1 else np.moveaxis(values, -1, 0)))
