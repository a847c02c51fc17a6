# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The rotor's encoder, whose likelihood needs no filter: the rotor's speed follows from the commands alone.

Single samples of a real encoder can be far off (a held rotor, a wrong stamp). A residual beyond the gate costs a constant and
has no gradient.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fish_sysid.dataset.experiment import Experiment
from fish_sysid.estimation.ekf_types import Array, Noise

NORMAL_MAD = 0.6745  # median of |x| over the standard deviation of a normal distribution
SMALLEST = 0.5  # of the usual noise


@dataclass(frozen=True)
class EncoderTerms:
    """What the encoder adds to a pass over M trials with K free parameters."""

    # (M,) sum of -min(r^2, gate) / 2 - log(sd sqrt(2 pi)), r = (encoder - rotor) / sd
    log_likelihood: Array
    samples: Array  # (M,)
    gradient: Array  # (M, K) of -log likelihood
    normal: Array  # (M, K, K)
    whitened: Array  # (T, M) r, NaN without a sample


def encoder_terms(
    experiment: Experiment, noise: Noise, rotor: Array, d_rotor: Array
) -> EncoderTerms:
    """Terms of the model's rotor speed (T, M) [rad/s] and of its derivatives (T, M, K)."""
    sampled = np.isfinite(experiment.encoder) & (
        np.arange(experiment.length)[:, None] < experiment.steps
    )
    r = np.where(sampled, (experiment.encoder - rotor) / noise.encoder, 0.0)
    inside = sampled & (r**2 < noise.gate_encoder)
    pull, J = np.where(inside, r, 0.0), -np.where(inside[..., None], d_rotor, 0.0) / noise.encoder
    samples = sampled.sum(axis=0)
    rows, columns = J.transpose(1, 2, 0), J.transpose(1, 0, 2)  # by trial
    return EncoderTerms(
        -0.5 * np.sum(np.minimum(r**2, noise.gate_encoder), axis=0)
        - samples * np.log(noise.encoder * np.sqrt(2.0 * np.pi)),
        samples,
        (rows @ pull.T[..., None])[..., 0],
        rows @ columns,
        np.where(sampled, r, np.nan),
    )


def encoder_noise(residual: Array, usual: float) -> float:
    """Standard deviation [rad/s] of residuals (NaN: no sample) by their median; the usual one where there are none."""
    sizes = np.abs(residual[np.isfinite(residual)])
    return max(float(np.median(sizes)) / NORMAL_MAD, SMALLEST * usual) if len(sizes) else usual


def commanded_residual(experiment: Experiment) -> Array:
    """(T, M) encoder less the commanded speed [rad/s], which an ideal motor has one step later."""
    commanded = np.concatenate([experiment.commands[:1, :, 0], experiment.commands[:-1, :, 0]])
    return np.asarray(experiment.encoder - commanded)
