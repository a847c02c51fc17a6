# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The policy network's weights as one flat vector, and back."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fish_control.policy_spec import HIDDEN, OUTPUTS

Array = NDArray[np.float64]
LAYERS = HIDDEN  # 6-128-128-64-6


@dataclass(frozen=True)
class Form:
    """What is learned: layer sizes, and what the first layer looks at (`Law.inputs`)."""

    layers: tuple[int, ...]
    inputs: str


FORMS = {
    "network": Form(LAYERS, "policy"),  # the paper's; what the controller loads
    "schedule": Form((2, len(OUTPUTS)), "schedule"),  # baseline: by wanted speed and curvature
    "constant": Form((0, len(OUTPUTS)), "none"),  # baseline; the controller loads these, too
}


def weight_count(layers: tuple[int, ...] = LAYERS) -> int:
    """Numbers in the flat vector: W (out, in) row-major, then b, layer after layer."""
    return sum(n_out * (n_in + 1) for n_in, n_out in itertools.pairwise(layers))


def split(flat: Any, layers: tuple[int, ...] = LAYERS) -> list[tuple[Any, Any]]:
    """Views (W, b) of every layer of a flat NumPy array or torch tensor."""
    views, at = [], 0
    for n_in, n_out in itertools.pairwise(layers):
        W = flat[at : at + n_out * n_in].reshape(n_out, n_in)
        b = flat[at + n_out * n_in : at + n_out * (n_in + 1)]
        views.append((W, b))
        at += n_out * (n_in + 1)
    return views


def initial_weights(
    rng: np.random.Generator, start: Mapping[str, float], layers: tuple[int, ...] = LAYERS
) -> Array:
    """He-uniform hidden layers, a last layer a hundred times smaller whose bias gives the gains `start`.

    A policy that starts at (nearly) constant gains can swim from the first step, so that no window is wasted on a fish
    that turns in circles.
    """
    flat = np.zeros(weight_count(layers))
    views = split(flat, layers)
    for k, (W, b) in enumerate(views):
        bound = np.sqrt(6.0 / max(W.shape[1], 1)) * (0.01 if k == len(views) - 1 else 1.0)
        W[:] = rng.uniform(-bound, bound, W.shape)
        if k == len(views) - 1:
            share = [(start[o.name] - o.low) / (o.high - o.low) for o in OUTPUTS]
            b[:] = np.arctanh(np.clip(2.0 * np.array(share) - 1.0, -0.999, 0.999))
    return flat


def to_tensors(flat: Array, layers: tuple[int, ...] = LAYERS) -> dict[str, Array]:
    """Names of the weights file."""
    tensors = {}
    for k, (W, b) in enumerate(split(np.array(flat), layers)):
        tensors[f"layers.{k}.weight"], tensors[f"layers.{k}.bias"] = W, b
    return tensors


def from_tensors(tensors: Mapping[str, Array], layers: tuple[int, ...] = LAYERS) -> Array:
    """Flat vector of a weights file's tensors."""
    names = [f"layers.{k}.{kind}" for k in range(len(layers) - 1) for kind in ("weight", "bias")]
    return np.concatenate([np.asarray(tensors[name], dtype=float).ravel() for name in names])
