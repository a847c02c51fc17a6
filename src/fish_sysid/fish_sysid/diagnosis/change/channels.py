# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What is compared: stroke means, harmonics of the stroke, and the camera's clock, trial by trial.

A column is an array (C, 12) at the centres of the stroke means, for the channels

    surge, sway [m/s], yaw rate, camera's less the gyro's yaw rate [rad/s], real and imaginary parts of the harmonics

and an array (W, 2) in windows of four seconds, for the channels

    age of the images beyond the known one [rad], angle by the gyro [rad]

both projections of camera heading less gyro angle: on its rate of change, and on the gyro angle itself. Last come the rows of
`symmetry.accelerometer`: the camera's second derivative less the accelerometer's force, turned by the camera's heading; and
turns by the IMU's orientation less those by its gyro, projected on the latter, in windows of four seconds.

The harmonics are amplitudes of IMU signals at the rotor's stroke, relative to the phase of its command. In a
window of weights w about a centre, with the phase phi of the command's analytic signal,

    H_k = 2 sum of w (x - mean) exp(-i k phi) / sum of w

A fish that is mirror-symmetric and swims straight turns and slips at the stroke itself, and surges at twice it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import hilbert
from scipy.sparse import csr_matrix

from fish_sim.model import DT
from fish_sysid.dataset.camera import gyro_windows
from fish_sysid.dataset.experiment import Experiment, Frames
from fish_sysid.dataset.imu import orientation_windows
from fish_sysid.diagnosis.symmetry.accelerometer import force_rows
from fish_sysid.diagnosis.symmetry.regression import Rows
from fish_sysid.diagnosis.symmetry.stroke_means import StrokeMeans, filled, stroke_means
from fish_sysid.prediction.stroke_average import stroke_mean

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]


HALF_WIDTH = 1.0  # s, of a window: four strokes at 2 Hz
LEAST_SPEED = 1.0  # rad/s of the rotor; a slower one has no phase
# signal and multiple of the stroke
HARMONICS = (("gyro", 1), ("left", 1), ("ahead", 1), ("ahead", 2))


@dataclass(frozen=True)
class StrokeWeights:
    """Weights of a signal on the grid (T,) for C centres."""

    by_multiple: Mapping[int, csr_matrix]  # (C, T) complex
    rotor: Array  # (C,) rad/s, amplitude of the commanded speed
    stroke: Array  # (C,) rad/s

    @classmethod
    def of(cls, rotor: Array, centres: Array) -> StrokeWeights:
        """For the commanded speed (T,) of the rotor and centres (C,) [s]."""
        driven = np.asarray(hilbert(rotor - rotor.mean()))
        size, phase = np.abs(driven), np.unwrap(np.angle(driven))
        plain = _windows(centres, size > LEAST_SPEED)
        by_multiple = {}
        for k in {multiple for _, multiple in HARMONICS}:
            turned = np.exp(-1j * k * phase)
            mean = np.asarray(plain @ turned)
            by_multiple[k] = 2.0 * (plain.multiply(turned) - plain.multiply(mean[:, None])).tocsr()
        return cls(by_multiple, plain @ size, plain @ np.gradient(phase, DT))

    def amplitudes(self, gyro: Array, ahead: Array, left: Array) -> Complex:
        """(C, 4) of HARMONICS of signals (T,) without gaps."""
        values = {"gyro": gyro, "ahead": ahead, "left": left}
        return np.column_stack([self.by_multiple[k] @ values[name] for name, k in HARMONICS])


def _windows(centres: Array, turning: NDArray[np.bool_]) -> csr_matrix:
    """Normalised Hann windows (C, T) over the grid points where the rotor turns."""
    rows, columns, values = [], [], []
    for i, centre in enumerate(centres):
        first, last = (round((centre + side * HALF_WIDTH) / DT) for side in (-1.0, 1.0))
        k = np.arange(max(first, 0), min(last + 1, len(turning)))
        w = np.cos(0.5 * np.pi * (DT * k - centre) / HALF_WIDTH) ** 2 * turning[k]
        rows.append(np.full(len(k), i))
        columns.append(k)
        values.append(w / max(float(w.sum()), 1e-9))
    at = np.concatenate(rows), np.concatenate(columns)
    return csr_matrix((np.concatenate(values), at), shape=(len(centres), len(turning)))


MEANS = 4  # channels of stroke means
AT_CENTRES = MEANS + 2 * len(HARMONICS)
IN_WINDOWS = 2
FORCE = AT_CENTRES + IN_WINDOWS
ORIENTATION = FORCE + 1
CHANNELS = ORIENTATION + 1
NO_FORCE = Rows(np.zeros((0, 2)), np.zeros((0, 2)), np.zeros(0))
AGE = 0.05  # s, by which images are made older to see what that does


@dataclass(frozen=True)
class Swim:
    """What is known of one trial."""

    name: str
    means: StrokeMeans
    aged: Array  # (C, 3) surge, sway, yaw rate by the camera with images older by one second, to first order
    amplitudes: Complex  # (C, 4) of HARMONICS
    rotor: Array  # (C,) rad/s, amplitude of the rotor's command
    stroke: Array  # (C,) rad/s
    windows: Array  # (W, 4) rest on rate, length of rate, rest on gyro, length of gyro
    force: Rows  # (V,) of the accelerometer: the lever, the force and the force turned by 90 degrees, the difference
    turns: Array  # (Q, 2) of the IMU's orientation: rest on the gyro's turns, length of these

    @property
    def shape(self) -> tuple[int, int, int, int]:
        """(C, W, V, Q)."""
        return len(self.means.t), len(self.windows), len(self.force.measured), len(self.turns)

    @property
    def backwards(self) -> bool:
        """Whether it swims with the tail ahead in the mean."""
        return bool(self.means.velocity[:, 0].mean() < 0.0)

    def measured(self) -> Array:
        """(N,) all channels."""
        u, v, r = self.means.velocity.T
        turned = self.means.gyro
        centres = np.column_stack([u, v, np.where(np.isfinite(turned), turned, r), r - turned])
        both = np.hstack([centres, parts(self.amplitudes)])
        return self.flat(both, self.windows[:, [0, 2]], self.force.measured, self.turns[:, 0])

    def flat(
        self,
        centres: Array | None = None,
        windows: Array | None = None,
        force: Array | None = None,
        turns: Array | None = None,
    ) -> Array:
        """(N,) of a column (C, 12), (W, 2), (V,) and (Q,); None: zeros."""
        C, W, V, Q = self.shape
        centres = np.zeros((C, AT_CENTRES)) if centres is None else centres
        windows = np.zeros((W, IN_WINDOWS)) if windows is None else windows
        force = np.zeros(V) if force is None else force
        turns = np.zeros(Q) if turns is None else turns
        return np.concatenate([centres.ravel(), windows.ravel(), force, turns])

    def means_only(self, **channel: Array) -> Array:
        """(N,) of a column with some of u, v, r, d (C,) alone."""
        zero = np.zeros(len(self.means.t))
        four = np.column_stack([channel.get(name, zero) for name in "uvrd"])
        return self.flat(np.hstack([four, np.zeros((len(zero), AT_CENTRES - MEANS))]))

    @property
    def channel(self) -> NDArray[np.int64]:
        """(N,) which channel a row is."""
        C, W, V, Q = self.shape
        centres, windows = np.arange(AT_CENTRES), AT_CENTRES + np.arange(IN_WINDOWS)
        alone = np.repeat([FORCE, ORIENTATION], [V, Q])
        return np.concatenate([np.tile(centres, C), np.tile(windows, W), alone])


def parts(amplitudes: Complex) -> Array:
    """(C, 8) real and imaginary parts of amplitudes (C, 4)."""
    return np.stack([amplitudes.real, amplitudes.imag], axis=-1).reshape(len(amplitudes), -1)


def swims(experiment: Experiment) -> tuple[Swim, ...]:
    """Every trial that is long enough."""
    found = []
    for m, name in enumerate(experiment.names):
        alone = experiment.select([m])
        for means in stroke_means(alone):
            found.append(_swim(name, alone, means))
    return tuple(found)


def same_trials(days: Sequence[Swim], experiment: Experiment) -> tuple[Swim, ...]:
    """The swims of the trials of `days` in other recordings of them."""
    names = {swim.name for swim in days}
    return tuple(swim for swim in swims(experiment) if swim.name in names)


def _swim(name: str, alone: Experiment, means: StrokeMeans) -> Swim:
    frames, steps = alone.frames[0], int(alone.steps[0])
    rotor = alone.commands[:steps, 0, 0]
    felt = [alone.gyro[:steps, 0], *alone.accel[:steps, 0].T]
    weights = StrokeWeights.of(rotor, means.t)
    amplitudes = weights.amplitudes(*(filled(x) for x in felt))
    aged, windows = _aged(frames, means), gyro_windows(alone, 0)
    turns = orientation_windows(alone, 0)
    return Swim(
        name, means, aged, amplitudes, weights.rotor, weights.stroke, windows, _force(alone), turns
    )


def _force(alone: Experiment) -> Rows:
    """Rows of the accelerometer; none where it says too little."""
    frames, t = alone.frames[0], DT * np.arange(int(alone.steps[0]))
    found = force_rows(alone, 0, np.interp(t, frames.t, frames.pose[:, 2]))
    return NO_FORCE if found is None else found[0]


def _aged(frames: Frames, means: StrokeMeans) -> Array:
    """Change of the stroke-mean velocity (C, 3) per second by which images are older."""
    older = stroke_mean(frames.t + AGE, means.t)(frames.pose)[:, 3:]
    change = (older - means.velocity) / AGE
    return np.where(np.isfinite(change), change, 0.0)
