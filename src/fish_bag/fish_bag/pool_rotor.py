# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The real robot's rotor command, rebuilt from what its ROS 1 recordings hold.

The bags carry amplitude A and frequency f of every control loop, but not the speed sent to the motor. Every
loop at time t_j advances a phase and sends one speed, which the motor holds until the next:

    theta_j = theta_{j-1} + 2 pi f_j (t_j - t_{j-1}),   phi_dot = -A_j 2 pi f_j sin(theta_j + delta(t)),
    first-order lag tau

The robot's own loop times are not exact, so theta slips by a slow delta(t): straight pieces, fitted with
tau to the speed that the encoder measured. The minus sign: the motor turns clockwise for positive speed,
REP 103 counts the other way.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares
from scipy.signal import lfilter

GRID_S = 1e-3  # s, step on which the staircase is filtered
KNOT_S = 1.0  # s between corners of delta(t)
FIRST_PHASES = np.arange(0, 2 * np.pi, 0.2)  # starting values of delta [rad]
FIRST_LAG_S = 0.007  # s
SLACK = 2.0  # rad/s; residuals beyond this count less
STEP_S = 0.01  # s between rebuilt commands


@dataclass(frozen=True)
class RotorCommand:
    """Rebuilt joint_command of the rotor at a steady rate."""

    t: np.ndarray  # (N,) [s]
    phase: np.ndarray  # (N,) oscillation phase [rad]
    speed: np.ndarray  # (N,) phi_dot, REP 103 sign [rad/s]
    lag_s: float  # fitted tau
    residual: float  # median of abs(encoder - rebuilt) [rad/s]


class _Loops:
    """The control loops of one run, on a fine grid of time."""

    def __init__(
        self, t: np.ndarray, amplitude: np.ndarray, frequency_hz: np.ndarray, end: float
    ) -> None:
        self.omega = 2 * np.pi * frequency_hz
        self.amplitude, self.start = amplitude, t[0]
        self.grid = np.arange(t[0], end + GRID_S, GRID_S)
        self.loop = np.searchsorted(t, self.grid, side="right") - 1
        self.theta = np.concatenate([[0.0], np.cumsum(self.omega[1:] * np.diff(t))])
        self.knots = np.linspace(t[0], t[-1], max(2, round((t[-1] - t[0]) / KNOT_S) + 1))

    def phase(self, slip: np.ndarray) -> np.ndarray:
        """theta + delta on the grid."""
        return np.asarray(self.theta[self.loop] + np.interp(self.grid, self.knots, slip))

    def speed(self, slip: np.ndarray, lag_s: float) -> np.ndarray:
        """phi_dot on the grid."""
        held = self.amplitude * self.omega
        command = -held[self.loop] * np.sin(self.phase(slip))
        decay = np.exp(-GRID_S / max(lag_s, 1e-6))
        return np.asarray(lfilter([1 - decay], [1, -decay], command))


def rebuild_rotor_command(
    t_loop: np.ndarray,
    amplitude: np.ndarray,
    frequency_hz: np.ndarray,
    t_encoder: np.ndarray,
    encoder_speed: np.ndarray,
    end: float,
) -> RotorCommand:
    """Fit the phase to the encoder and return the command every 10 ms.

    Args:
        t_loop, amplitude, frequency_hz: (L,) loops [s, rad, Hz].
        t_encoder, encoder_speed: (E,) samples [s, rad/s, REP 103 sign].
        end: until when commands are wanted [s]; after the last loop its speed is held.
    """
    loops = _Loops(t_loop, amplitude, frequency_hz, end)
    use = (t_encoder > t_loop[0] + 0.2) & (t_encoder < t_loop[-1])
    t_fit, measured = t_encoder[use], encoder_speed[use]

    def residuals(p: np.ndarray) -> np.ndarray:
        return np.asarray(
            np.interp(t_fit, loops.grid, loops.speed(p[1:], p[0] * FIRST_LAG_S)) - measured
        )

    def cost(first_phase: float) -> float:
        early = np.abs(residuals(np.concatenate([[1.0], np.full(len(loops.knots), first_phase)])))[
            :100
        ]
        return float(np.mean(np.minimum(early, 30.0)))

    start = np.full(1 + len(loops.knots), min(FIRST_PHASES, key=cost))
    start[0] = 1.0
    limits = (np.full_like(start, -np.inf), np.full_like(start, np.inf))
    limits[0][0], limits[1][0] = 0.1, 5.0
    fit = least_squares(
        residuals, start, bounds=limits, loss="soft_l1", f_scale=SLACK, diff_step=1e-4, x_scale=0.1
    )
    lag_s, slip = fit.x[0] * FIRST_LAG_S, fit.x[1:]
    t = np.arange(t_loop[0] - 0.5, end, STEP_S)
    before = t < loops.start
    phase = np.interp(t, loops.grid, loops.phase(slip))
    speed = np.where(before, 0.0, np.interp(t, loops.grid, loops.speed(slip, lag_s)))
    return RotorCommand(t, phase, speed, lag_s, float(np.median(np.abs(residuals(fit.x)))))
