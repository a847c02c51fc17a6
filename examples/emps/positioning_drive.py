# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Which friction does a positioning drive hide? The method of the fish on a stage with one degree of freedom.

    python examples/emps/positioning_drive.py emps.csv.gz

The file: t [s], vir (motor current reference, V), qm (measured position, m), gzipped or not; the public EMPS benchmark of
A. Janot, M. Gautier and M. Brunot (2019). The drive is under feedback: its current is no experimenter's choice.

    M q'' = G vir - Fv q' + sum_j c_j phi_j(q, q', vir) + w,    w' = -w / tau + noise

As for the fish: a latent force w stands for what the model lacks, a Kalman filter runs over the recorded input, its innovations
are white when nothing is missing, all parameters are refitted under every hypothesis, candidates compete, and one at a time is
added while a tempered likelihood-ratio test asks for more. With q' from the encoder inside phi_j the innovations are linear in
the parameters, so every fit is a least-squares problem. The last part of the record is held out.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_discrete_are
from scipy.signal import butter, filtfilt
from scipy.stats import chi2

Array = NDArray[np.float64]

FORCE = 35.15065  # N/V, force on the stage per current reference; from the data's documentation
CUTOFF = 100.0  # Hz, of the zero-phase filter before differences are taken
BAND = 20.0  # Hz, in which force errors are stated; measured and model force pass the same filter
EVERY = 5  # samples of the file to one of the filter
STILL = 1e-3  # m/s, dry friction turns over within this speed
WRENCH_TIME = 0.05  # s, tau of the latent force
LATENT = 2.0 ** np.arange(-9.0, 1.0)  # m/s^2, tried
ENCODER = 1e-7  # m, standard deviation of a position sample
TRAINING = 0.6  # share of the record
LEVEL, TEMPER, MOST = (
    0.01,
    10.0,
    4,
)  # false alarms of the search; nats of innovations per nat of evidence; effects


@dataclass(frozen=True)
class Record:
    """Samples (N,) at a constant period; all but the position are means from one sample to the next."""

    period: float  # s
    force: Array  # N, from the current reference
    position: Array  # m, as measured
    smooth: Array  # m, low-pass filtered forwards and backwards
    velocity: Array  # m/s
    acceleration: Array  # m/s^2


Term = Callable[[Record], Array]

# name -> force per unit coefficient; the inertia and the viscous term are in every hypothesis
CANDIDATES: dict[str, tuple[str, Term]] = {
    "dry_friction": ("N", lambda r: -np.tanh(r.velocity / STILL)),
    "quadratic_drag": ("N s^2/m^2", lambda r: -np.abs(r.velocity) * r.velocity),
    "cubic_drag": ("N s^3/m^3", lambda r: -(r.velocity**3)),
    "constant_force": ("N", lambda r: np.ones_like(r.velocity)),
    "spring": ("N/m", lambda r: r.smooth.mean() - r.smooth),
    "lag_of_the_motor": ("s", lambda r: -np.gradient(_low_pass(r.force, r.period, BAND), r.period)),
    "one_sided_friction": ("N", lambda r: -np.maximum(np.tanh(r.velocity / STILL), 0.0)),
    "stribeck": ("N", lambda r: -np.tanh(r.velocity / STILL) * np.exp(-((r.velocity / 0.02) ** 2))),
}


@dataclass(frozen=True)
class Fit:
    """One hypothesis, all its parameters fitted."""

    terms: tuple[str, ...]
    mass: float  # kg
    viscous: float  # N s/m
    coefficients: dict[str, float]
    errors: dict[str, float]  # standard errors of the coefficients
    log_likelihood: float  # nats, up to a constant that all hypotheses share
    samples: int
    latent: float  # N, standard deviation of the latent force


@dataclass(frozen=True)
class Answer:
    """What the search found."""

    nominal: Fit
    final: Fit
    ranking: dict[str, float]  # nats over the nominal fit, one term at a time
    held_out: dict[str, float]  # model -> relative error of the force, held out


def load(path: Path) -> Record:
    """Read the CSV. Raises OSError when it is absent."""
    table = np.genfromtxt(path, delimiter=",", names=True)
    return record(table["t"], FORCE * table["vir"], table["qm"])


def record(t: Array, force: Array, position: Array) -> Record:
    """Velocity and acceleration by central differences of the smoothed position."""
    period = float(np.median(np.diff(t)))
    smooth = _low_pass(position, period)
    velocity = np.gradient(smooth, period)
    means = (_means(a) for a in (force, smooth, velocity, np.gradient(velocity, period)))
    force, smooth, velocity, acceleration = means
    return Record(
        EVERY * period,
        force,
        position[: EVERY * len(force) : EVERY],
        smooth,
        velocity,
        acceleration,
    )


def _means(signal: Array) -> Array:
    """Over the EVERY samples from each sample that is kept to the next: what acts between two positions."""
    count = len(signal) // EVERY
    out: Array = signal[: EVERY * count].reshape(count, EVERY).mean(axis=1)
    return out


def _low_pass(signal: Array, period: float, cutoff: float = CUTOFF) -> Array:
    b, a = butter(4, 2.0 * cutoff * period)
    out: Array = filtfilt(b, a, signal)
    return out


def part(r: Record, first: int, last: int) -> Record:
    """A stretch of a record."""
    cut = {
        k: getattr(r, k)[first:last]
        for k in ("force", "position", "smooth", "velocity", "acceleration")
    }
    return Record(r.period, **cut)


@dataclass(frozen=True)
class Whitened:
    """Innovations over their standard deviation, settled samples only: of the position, and of what each term would add."""

    latent: float  # m/s^2, standard deviation of the latent acceleration
    position: Array  # (N,)
    terms: dict[str, Array]  # (N,) each; "force" and "viscous" among them
    scale: float  # m, standard deviation of an innovation


def whiten(r: Record, latent: float) -> Whitened:
    """Position and all terms through the steady Kalman filter of (q, q', w), which is linear in them."""
    kept = np.exp(-r.period / WRENCH_TIME)
    A = np.array([[1.0, r.period, 0.5 * r.period**2], [0.0, 1.0, r.period], [0.0, 0.0, kept]])
    B = np.array([0.5 * r.period**2, r.period, 0.0])
    Q = np.diag([1e-20, 1e-20, latent**2 * (1.0 - kept**2)])
    P = solve_discrete_are(A.T, np.array([[1.0], [0.0], [0.0]]), Q, np.array([[ENCODER**2]]))
    scale = float(np.sqrt(P[0, 0] + ENCODER**2))
    gain = P[:, 0] / scale**2
    terms = {
        "force": r.force,
        "viscous": -r.velocity,
        **{name: term(r) for name, (_, term) in CANDIDATES.items()},
    }
    inputs = np.column_stack(list(terms.values()))
    x = np.zeros(
        (3, 1 + inputs.shape[1])
    )  # the first column follows the position, each other one a term
    x[0, 0] = r.position[0]
    out, measured = np.empty((len(r.position), x.shape[1])), np.zeros(x.shape[1])
    for k, (position, force) in enumerate(zip(r.position, inputs, strict=True)):
        measured[0] = position
        out[k] = measured - x[0]
        x = A @ (x + np.outer(gain, out[k]))
        x[:, 1:] += np.outer(B, force)
    out = out[round(5 * WRENCH_TIME / r.period) :] / scale
    columns = dict(zip(terms, -out[:, 1:].T, strict=True))
    return Whitened(latent, out[:, 0], columns, scale)


def fit(w: Whitened, terms: tuple[str, ...]) -> Fit:
    """Mass, viscous friction and the terms' coefficients: least squares on whitened innovations."""
    A = np.column_stack([w.terms[name] for name in ("force", "viscous", *terms)])
    theta, *_ = np.linalg.lstsq(A, w.position, rcond=None)
    n, variance = len(A), float(np.mean((w.position - A @ theta) ** 2))
    mass = 1.0 / float(theta[0])
    deviation = mass * np.sqrt(variance * np.diag(np.linalg.inv(A.T @ A)))
    values = {name: float(c) * mass for name, c in zip(terms, theta[2:], strict=True)}
    errors = {name: float(d) for name, d in zip(terms, deviation[2:], strict=True)}
    density = -n * (0.5 * np.log(variance) + np.log(w.scale))
    return Fit(
        terms, mass, float(theta[1]) * mass, values, errors, float(density), n, w.latent * mass
    )


def best_fit(filters: Sequence[Whitened], terms: tuple[str, ...]) -> Fit:
    """The latent force as strong as the data ask for under this hypothesis."""
    return max((fit(w, terms) for w in filters), key=lambda f: f.log_likelihood)


def force_error(r: Record, f: Fit) -> float:
    """|force - model| / |force| below BAND: what the current would have to be for the motion that was measured."""
    model = f.mass * r.acceleration + f.viscous * r.velocity
    for name, c in f.coefficients.items():
        model = model - c * CANDIDATES[name][1](r)
    wanted, given = (_low_pass(a, r.period, BAND) for a in (r.force, model))
    return float(np.linalg.norm(wanted - given) / np.linalg.norm(wanted))


def enough(candidates: int) -> float:
    """Nats that a term must gain: likelihood-ratio test over all candidates, tempered."""
    return TEMPER * 0.5 * float(chi2.isf(LEVEL / max(candidates, 1), 1))


def diagnose(r: Record) -> Answer:
    """Add one term at a time while one gains enough and has the sign of its physics."""
    split = round(TRAINING * len(r.force))
    training, held = part(r, 0, split), part(r, split, len(r.force))
    filters = [whiten(training, latent) for latent in LATENT]
    nominal = base = best_fit(filters, ())
    ranking: dict[str, float] = {}
    while len(base.terms) < MOST:
        rivals = [
            best_fit(filters, (*base.terms, name)) for name in CANDIDATES if name not in base.terms
        ]
        if not base.terms:
            ranking = {f.terms[-1]: f.log_likelihood - base.log_likelihood for f in rivals}
        usable = [f for f in rivals if sound(f)]
        best = max(usable, key=lambda f: f.log_likelihood, default=None)
        if best is None or best.log_likelihood - base.log_likelihood < enough(len(rivals)):
            break
        base = best
    models = {"without": nominal, "with": base}
    return Answer(nominal, base, ranking, {k: force_error(held, f) for k, f in models.items()})


def sound(f: Fit) -> bool:
    """Friction takes energy, masses are positive."""
    dissipative = ("dry_friction", "quadratic_drag", "cubic_drag")
    return (
        f.mass > 0.0
        and f.viscous > 0.0
        and all(f.coefficients.get(name, 0.0) >= 0.0 for name in dissipative)
    )


def show(answer: Answer) -> None:
    """Print what was found."""
    print("term alone            gain, nats")
    for name, gain in sorted(answer.ranking.items(), key=lambda item: -item[1]):
        print(f"  {name:20} {gain:9.0f}")
    for label, f in (("without", answer.nominal), ("with", answer.final)):
        error = answer.held_out[label]
        print(
            f"{label:8} mass {f.mass:6.1f} kg, viscous {f.viscous:6.1f} N s/m, latent force {f.latent:5.2f} N, "
            f"held-out error of the force {100 * error:4.1f} %"
        )
    for name in answer.final.terms:
        unit = CANDIDATES[name][0]
        print(
            f"missing: {name} {answer.final.coefficients[name]:.4g} +- {answer.final.errors[name]:.2g} {unit}"
        )
    if not answer.final.terms:
        print("nothing is missing")


def main(argv: list[str] | None = None) -> int:
    """Diagnose a file."""
    parser = argparse.ArgumentParser(description="which friction does a positioning drive hide?")
    parser.add_argument("data", type=Path, help="emps.csv or emps.csv.gz with columns t, vir, qm")
    path = parser.parse_args(argv).data
    if not path.is_file():
        print(
            f"{path}: no such file; the data are the public EMPS benchmark (see README.md beside this script)",
            file=sys.stderr,
        )
        return 1
    show(diagnose(load(path)))
    return 0


if __name__ == "__main__":
    sys.exit(main())
