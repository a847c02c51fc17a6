"""How the nominal fish swims: steady speed over throttle, and the limit cycle of a stroke.

    python src/fish_sim/benchmarks/swimming.py [--out swimming.html]

Prints the steady surge speed against A^2 w^4 for several amplitudes and frequencies with a straight-line fit over
0.1 to 0.3 m/s (the paper found it nearly linear there), and how well the stroke repeats; writes a page of plots.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray
from plotly.subplots import make_subplots

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


def page(sweeps: list[Sweep], cycle: Array, stroke: int) -> go.Figure:
    """Speed over throttle; head and tail rates over angles in steady swimming."""
    figure = make_subplots(1, 2, subplot_titles=("steady speed", "limit cycle at 2 Hz, throttle 0.5"))
    for s in sweeps:
        figure.add_scatter(
            x=s.throttle / S_MAX, y=s.speed, name=f"{s.frequency:.3g} Hz", mode="lines+markers"
        )
    motion = cycle[-5 * stroke - 1 :, 0]
    size = 3 + 3
    angles = {"head yaw": motion[:, 2] - motion[:, 2].mean()}
    rates = {"head yaw": motion[:, size + 2]}
    for i in (1, 2, 3):
        angles[f"tail joint {i}"] = motion[:, 2 + i] - motion[:, 1 + i]
        rates[f"tail joint {i}"] = motion[:, size + 2 + i] - motion[:, size + 1 + i]
    for name in angles:
        figure.add_scatter(x=angles[name], y=rates[name], name=name, mode="lines", row=1, col=2)
    figure.update_xaxes(title="A^2 w^4 / S_max", row=1, col=1)
    figure.update_yaxes(title="m/s", row=1, col=1)
    figure.update_xaxes(title="angle, rad", row=1, col=2)
    figure.update_yaxes(title="rate, rad/s", row=1, col=2)
    return figure


def print_sweep(s: Sweep) -> None:
    shown = "  ".join(f"{t:.2f}: {v:.3f}" for t, v in zip(THROTTLES[::4], s.speed[::4], strict=True))
    slope, intercept, r2 = straight_line([s])
    print(f"{s.frequency:4.3g} Hz, speed [m/s] at throttle  {shown}")
    print(
        f"         {LINEAR[0]:g} to {LINEAR[1]:g} m/s: {intercept:.3f} + {slope:.3f} throttle, R^2 {r2:.4f}"
    )


def repetition(cycle: Array, stroke: int) -> float:
    """Largest difference of the rates of two strokes, relative to their largest value."""
    rates = cycle[:, 0, 6:12]
    return float(np.abs(rates[-1 - stroke :] - rates[-1 - 2 * stroke : -stroke]).max() / np.abs(rates).max())


def main() -> int:
    parser = argparse.ArgumentParser(description="steady speed and limit cycle of the nominal fish")
    parser.add_argument("--out", type=Path, default=Path("swimming.html"), help="page of plots to write")
    out = parser.parse_args().out
    sweeps = [sweep(f) for f in FREQUENCIES]
    for s in sweeps:
        print_sweep(s)
    slope, intercept, r2 = straight_line(sweeps)
    print(f"all together: {intercept:.3f} + {slope:.3f} throttle, R^2 {r2:.4f}")
    cycle, stroke = swim(2.0, np.array([0.5 * S_MAX])), round(0.5 / DT)
    print(f"2 Hz, throttle 0.5: the stroke repeats to {repetition(cycle, stroke):.1e} of its largest rate")
    page(sweeps, cycle, stroke).write_html(out, include_plotlyjs=True)
    print(f"wrote {out}")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
