# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""A servo or linkage that changed: what it makes of the logged rudder commands (T,), and what OLD's fish does with these.

The black box of `rows` predicts every channel from the commands. A servo with another zero or another gain gets other commands:

    change of a channel = F(commands of the servo) b - F(logged commands) b,   b: OLD's ridge regression on the black box F

So a change of the servo has the shape that OLD's fish gives it, which a plant of another structure does not share with the model.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from fish_sim.model import DT
from fish_sysid.dataset.experiment import Experiment
from fish_sysid.diagnosis.change.candidates import SHARE, typical
from fish_sysid.diagnosis.change.channels import AT_CENTRES, Swim
from fish_sysid.diagnosis.change.rows import TrialRows, black_box
from fish_sysid.diagnosis.change.shared_fit import Settled, scaled_rows, settled
from fish_sysid.diagnosis.symmetry.stroke_means import features

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Servo:
    """One name of the vocabulary with one parameter, and the values that are tried."""

    parameter: str
    unit: str
    act: Callable[[Array, float], Array]
    neutral: float  # changes nothing
    # (V,) that the gyro's answer is asked for
    tried: Array = field(default_factory=lambda: np.zeros(0))


def lagged(rudder: Array, time: float) -> Array:
    """Rudder commands (T,) through a first-order lag of `time` [s]."""
    if time <= 0.0:
        return rudder
    kept = np.exp(-DT / time)
    return np.asarray(lfilter([1.0 - kept], [1.0, -kept], rudder, zi=[kept * rudder[0]])[0])


def delayed(rudder: Array, time: float) -> Array:
    """Rudder commands (T,) `time` [s] late."""
    t = DT * np.arange(len(rudder))
    return np.asarray(np.interp(t - time, t, rudder))


def with_play(rudder: Array, play: float) -> Array:
    """Rudder commands (T,) [rad] through a linkage with `play` [rad] to either side."""
    out, at = np.empty_like(rudder), float(rudder[0])
    for k, command in enumerate(rudder.tolist()):
        at = min(max(at, command - play), command + play)
        out[k] = at
    return out


TIMES = np.arange(0.02, 0.29, 0.02)
SERVOS = {
    "rudder_lag": Servo("time_constant", "s", lagged, 0.0, TIMES),
    "rudder_delay": Servo("delay", "s", delayed, 0.0, TIMES),
    "rudder_backlash": Servo("play", "rad", with_play, 0.0, np.arange(0.02, 0.15, 0.02)),
    "rudder_gain": Servo(
        "factor", "1", lambda rudder, factor: factor * rudder, 1.0,
        np.array([0.5, 0.6, 0.7, 0.75, 0.8, 0.85, 0.9, 0.95, 1.05, 1.1, 1.15, 1.2, 1.3, 1.4, 1.5]),
    ),
    # no values: what it adds to the mean yaw rate is also the gyro's bias
    "rudder_offset": Servo("offset", "rad", lambda rudder, offset: rudder + offset, 0.0),
}  # fmt: skip
ANSWERED = {name: servo for name, servo in SERVOS.items() if len(servo.tried)}


def with_servo(experiment: Experiment, name: str, value: float) -> Experiment:
    """The recordings with commands as the servo passed them on."""
    commands = experiment.commands.copy()
    for m, steps in enumerate(experiment.steps):
        commands[:steps, m, 1] = SERVOS[name].act(commands[:steps, m, 1], value)
    return replace(experiment, commands=commands)


FORM = 1  # number of the form that OLD's trials say; form 0 is the model's
BY_OLD = ("rudder_offset", "rudder_gain")  # servos with this form


@dataclass(frozen=True)
class OldAnswer:
    """The black box of OLD."""

    coefficients: Array  # (P,)

    @classmethod
    def of(cls, old: Sequence[TrialRows]) -> OldAnswer:
        """By ridge regression on OLD's trials, candidates of `rows` free as in `shared_fit`."""
        by_old: Settled = settled(old)
        used = np.flatnonzero(np.isfinite(by_old.precision))
        G, h = np.diag(by_old.precision[used]), np.zeros(len(used))
        for trial in old:
            columns = np.hstack([trial.black_box, *trial.candidates.values()])[:, used]
            x, y = scaled_rows(trial, columns, by_old.noise)
            G, h = G + x.T @ x, h + x.T @ y
        return cls(np.asarray(np.linalg.solve(G, h)[: old[0].black_box.shape[1]]))

    def added(
        self, rows: Sequence[TrialRows], days: Sequence[Swim], experiment: Experiment
    ) -> list[TrialRows]:
        """The rows with a further form of each of BY_OLD."""
        found = []
        for row, swim in zip(rows, days, strict=True):
            m = experiment.names.index(swim.name)
            commands = experiment.commands[: experiment.steps[m], m]
            more = {
                (name, FORM): self._column(name, row, swim, commands)
                for name in BY_OLD
                if (name, 0) in row.candidates
            }
            found.append(replace(row, candidates={**row.candidates, **more}))
        return found

    def _column(self, name: str, row: TrialRows, swim: Swim, commands: Array) -> Array:
        """(N, 1) per typical strength."""
        servo = SERVOS[name]
        value = servo.neutral + SHARE * (typical(name, servo.parameter) - servo.neutral)
        other = np.column_stack([commands[:, 0], servo.act(commands[:, 1], value)])
        even, odd, throttle, rudder = features(other, swim.means.t)
        means = replace(swim.means, even=even, odd=odd, throttle=throttle, rudder=rudder)
        count = len(means.t) * AT_CENTRES
        of_model = SHARE * row.candidates[name, 0][:count, 0].reshape(-1, AT_CENTRES)
        changed = black_box(replace(swim, means=means), of_model)
        change = np.nan_to_num(changed - black_box(swim, np.zeros_like(of_model)))
        return np.where(row.valid[:, None], (change @ self.coefficients)[:, None] / SHARE, 0.0)
