# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""How the nominal fish swims: steady speed over throttle, and the limit cycle of a stroke.

    python src/fish_sim/benchmarks/swimming.py [--out swimming.svg]

Prints the steady surge speed against A^2 w^4 for several amplitudes and frequencies with a straight-line fit over
0.1 to 0.3 m/s (the paper found it nearly linear there), and how well the stroke repeats; draws both.
The picture of docs/results/simulator.md, src/fish_sim/docs/swimming.svg, was drawn by it.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from fish_sim.model import DT
from fish_sim.robot import Robot
from fish_sim.step import Stepper

Array = NDArray[np.float64]

FREQUENCIES = (1 / 0.6, 2.0, 1 / 0.45, 2.5)  # Hz, a stroke is a whole number of periods of 10 ms
S_MAX = (12.0 * (4 * np.pi) ** 2) ** 2  # rad^2/s^4, throttle 1
THROTTLES = np.linspace(0.02, 1.0, 25)
SECONDS = 40.0
LINEAR = (0.1, 0.3)  # m/s


@dataclass(frozen=True)
class Sweep:
    """Steady swimming at one stroke frequency."""

    frequency: float  # Hz
    throttle: Array  # A^2 w^4 [rad^2/s^4], only where A <= 40 rad
    speed: Array  # m/s, mean surge speed of the last strokes


def swim(frequency: float, throttle: Array, seconds: float = SECONDS) -> Array:
    """States (T + 1, B, NS) from rest at constant throttle, rudder centred."""
    stepper = Stepper.of(Robot())
    omega = 2 * np.pi * frequency
    time = DT * np.arange(1, round(seconds / DT) + 1)
    rotor = np.sqrt(throttle) / omega * np.sin(omega * time)[:, None]  # A w = sqrt(A^2 w^4) / w
    commands = np.stack([rotor, np.zeros_like(rotor)], axis=-1)
    return stepper.rollout(stepper.rest(), commands, stepper.parameters(Robot()))


def steady_speed(states: Array, frequency: float) -> Array:
    """Mean speed of travel over the last ten strokes [m/s]; the start leaves the course slightly curved."""
    stroke = round(1 / frequency / DT)
    mean = np.stack([states[-k * stroke - 1, :, :2] for k in range(11)])
    return np.linalg.norm(np.diff(mean, axis=0), axis=-1).mean(0) / (stroke * DT)


def sweep(frequency: float) -> Sweep:
    throttle = THROTTLES * S_MAX
    return Sweep(frequency, throttle, steady_speed(swim(frequency, throttle), frequency))


def straight_line(sweeps: list[Sweep]) -> tuple[float, float, float]:
    """(slope, intercept, R^2) of speed over A^2 w^4 / S_MAX between the speeds of LINEAR."""
    x, y = (np.concatenate([getattr(s, k) for s in sweeps]) for k in ("throttle", "speed"))
    inside = (LINEAR[0] <= y) & (y <= LINEAR[1])
    x, y = x[inside] / S_MAX, y[inside]
    slope, intercept = np.polyfit(x, y, 1)
    return slope, intercept, 1 - np.var(y - slope * x - intercept) / np.var(y)


def picture(sweeps: list[Sweep], cycle: Array, stroke: int) -> Figure:
    """Speed over throttle; head and tail rates over angles in steady swimming."""
    figure = Figure(figsize=(9.0, 3.6), layout="constrained")
    speeds, phases = figure.subplots(1, 2)
    for s in sweeps:
        speeds.plot(s.throttle / S_MAX, s.speed, ".-", linewidth=1, label=f"{s.frequency:.3g} Hz")
    speeds.axhspan(*LINEAR, color="0.93", label="paper: nearly linear")
    speeds.set(xlabel="$A^2 \\omega^4 / S_{max}$", ylabel="steady speed, m/s")
    motion = cycle[-stroke - 1 :, 0]
    links = motion.shape[1] // 2 - 4  # state: q, q', alpha, rotor speed
    size = 3 + links
    angles, rates = motion[:, 2:size], motion[:, size + 2 : 2 * size]
    phases.plot(angles[:, 0] - angles[:, 0].mean(), rates[:, 0], label="head yaw")
    for i, (angle, rate) in enumerate(zip(np.diff(angles).T, np.diff(rates).T, strict=True), 1):
        phases.plot(angle, rate, label=f"tail joint {i}")
    phases.set(xlabel="angle, rad", ylabel="rate, rad/s", title="limit cycle at 2 Hz, throttle 0.5")
    for axes in (speeds, phases):
        axes.grid(color="0.9")
        axes.legend(fontsize="small")
    return figure


def print_sweep(s: Sweep) -> None:
    shown = "  ".join(
        f"{t:.2f}: {v:.3f}" for t, v in zip(THROTTLES[::4], s.speed[::4], strict=True)
    )
    slope, intercept, r2 = straight_line([s])
    print(f"{s.frequency:4.3g} Hz, speed [m/s] at throttle  {shown}")
    print(
        f"         {LINEAR[0]:g} to {LINEAR[1]:g} m/s: {intercept:.3f} + {slope:.3f} throttle, R^2 {r2:.4f}"
    )


def repetition(cycle: Array, stroke: int) -> float:
    """Largest difference of the rates of two strokes, relative to their largest value."""
    rates = cycle[:, 0, 6:12]
    return float(
        np.abs(rates[-1 - stroke :] - rates[-1 - 2 * stroke : -stroke]).max() / np.abs(rates).max()
    )


def main() -> int:
    parser = argparse.ArgumentParser(description="steady speed and limit cycle of the nominal fish")
    parser.add_argument(
        "--out", type=Path, default=Path("swimming.svg"), help="picture to write (.svg or .png)"
    )
    out = parser.parse_args().out
    sweeps = [sweep(f) for f in FREQUENCIES]
    for s in sweeps:
        print_sweep(s)
    slope, intercept, r2 = straight_line(sweeps)
    print(f"all together: {intercept:.3f} + {slope:.3f} throttle, R^2 {r2:.4f}")
    cycle, stroke = swim(2.0, np.array([0.5 * S_MAX])), round(0.5 / DT)
    print(
        f"2 Hz, throttle 0.5: the stroke repeats to {repetition(cycle, stroke):.1e} of its largest rate"
    )
    with matplotlib.rc_context({"svg.fonttype": "none", "svg.hashsalt": "swimming"}):
        picture(sweeps, cycle, stroke).savefig(
            out, metadata={"Date": None} if out.suffix == ".svg" else None
        )
    print(f"wrote {out}")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
