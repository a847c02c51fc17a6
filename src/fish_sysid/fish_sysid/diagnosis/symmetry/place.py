# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Dependence on place: the regression of `galilei` with terms in the place.

Translating the fish in the pool changes nothing of its swimming, unless the water or the walls differ from place to place.
"""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
from numpy.typing import NDArray

from fish_node.pool import LENGTH, WIDTH
from fish_sim.effects.surroundings import NonuniformCurrent
from fish_sysid.diagnosis.symmetry.finding import Estimate
from fish_sysid.diagnosis.symmetry.galilei import (
    TOO_FEW_HEADINGS,
    black_box,
    carried,
    ground_velocity,
    in_body_frame,
)
from fish_sysid.diagnosis.symmetry.regression import Conclusion, Judged, RegressionTest, Rows
from fish_sysid.diagnosis.symmetry.stroke_means import StrokeMeans, Trials
from fish_sysid.estimation.thresholds import LEAST_NEAR_WALL, LEAST_SPREAD, SYMMETRY_GAIN

Array = NDArray[np.float64]

WALL_LENGTH = 0.2  # m over which a wall's influence fades
MARGIN, LEAST_BEYOND = 0.05, 0.01  # m and share of places that may seem to be beyond a wall
NEAR_WALL = 0.3  # of the influence at the wall
MEAN = ("mean_x", "mean_y")
TERMS = ("strain", "shear_x", "shear_y", "gyre_11", "gyre_12", "gyre_21", "gyre_22")
PATCHES = tuple((x, y) for x in (-0.33, 0.0, 0.33) for y in (-0.25, 0.25))  # of length and width
PATCH_WIDTH = 0.35  # m, standard deviation


def nearness(trial: StrokeMeans) -> Array:
    """A wall's influence (C,): 1 at the nearest wall, fading over WALL_LENGTH."""
    return np.asarray(np.exp(-np.maximum(gap(trial), 0.0) / WALL_LENGTH))


def gap(trial: StrokeMeans) -> Array:
    """Distance (C,) of the camera's point from the nearest wall in m, negative beyond it."""
    x, y = np.abs(trial.pose[:, 0]), np.abs(trial.pose[:, 1])
    return np.asarray(np.minimum(LENGTH / 2 - x, WIDTH / 2 - y))


def drive(trial: StrokeMeans) -> Array:
    """Root of the mean squared rotor speed (C,) of the last two seconds: a speed is about proportional to it."""
    return np.asarray(np.sqrt(np.maximum(trial.throttle.mean(axis=1), 0.0)))


def _relative(trials: Trials, coefficient: float, std: float) -> Estimate:
    """A change of speed per unit of drive as a share of the mean speed."""
    speed = np.concatenate([s.velocity[:, 0] for s in trials]).mean()
    scale = float(np.concatenate([drive(s) for s in trials]).mean() / max(abs(speed), 1e-6))
    return Estimate(float(coefficient) * scale, float(std) * scale, "1")


def _rows(trial: StrokeMeans, terms: Array) -> Rows:
    """Surge, then sway over ground, against a uniform flow and terms (2C, K) in the place."""
    return Rows(np.hstack([black_box(trial), carried(trial)]), terms, ground_velocity(trial))


def _one_place(trials: Trials) -> str:
    """Places vary by the smaller of both axes' standard deviations times the pool's shape."""
    x, y, _ = np.concatenate([s.pose for s in trials]).T
    spread = float(min(x.std(), y.std() * LENGTH / WIDTH))
    text = f"one part of the pool: places vary by {spread:.2f} m along it"
    return text if spread < LEAST_SPREAD else ""


def flow_of(term: str, value: float, x: Array, y: Array) -> tuple[Array | float, Array | float]:
    """Velocities (N,) [m/s] along x and y of a nonuniform current of one term, at places x and y (N,) [m]."""
    neutral = dict.fromkeys(NonuniformCurrent.parameters, 0.0)
    values = SimpleNamespace(**{**neutral, term: value})
    (vx, vy), _gradient = NonuniformCurrent.water(values, x, y, SimpleNamespace(), np)
    return vx, vy


def _flows(trial: StrokeMeans) -> Rows:
    """Terms (2C, 7): linear shear and the four largest gyres, with coefficient one."""
    x, y, _ = trial.pose.T
    flows = (np.column_stack(np.broadcast_arrays(*flow_of(name, 1.0, x, y))) for name in TERMS)
    return _rows(trial, np.column_stack([in_body_frame(trial, flow) for flow in flows]))


def _varying(judged: Judged, _: Trials) -> Conclusion:
    names, first = (*MEAN, *TERMS), -len(MEAN) - len(TERMS)
    parameters = {
        name: judged.estimate(first + i, NonuniformCurrent.parameters[name].unit)
        for i, name in enumerate(names)
    }
    found = judged.stands(SYMMETRY_GAIN, *range(-len(TERMS), 0))
    return found, "the water's velocity varies over the pool", parameters


VARYING_FLOW = RegressionTest(
    "nonuniform_current",
    "physics",
    assumes="the water's velocity is constant in time; commands alone drive the fish",
    needs="three trials over the pool, several headings at each place",
    lacking=_one_place,
    rows=_flows,
    spanned=TOO_FEW_HEADINGS,
    one_by_one=True,
    conclude=_varying,
)


def _not_at_walls(trials: Trials) -> str:
    beyond = np.concatenate([gap(s) < -MARGIN for s in trials]).mean()
    if beyond > LEAST_BEYOND:
        return f"{beyond:.0%} of the places are beyond the walls: they are not where they should be"
    near = np.concatenate([nearness(s) > NEAR_WALL for s in trials]).mean()
    if LEAST_NEAR_WALL < near < 1.0 - LEAST_NEAR_WALL:
        return ""
    return f"the fish is near a wall {near:.0%} of the time"


def _walls(trial: StrokeMeans) -> Rows:
    """Term (2C, 1): surge in proportion to the drive near a wall."""
    surge = nearness(trial) * drive(trial)
    return _rows(trial, np.concatenate([surge, np.zeros(len(surge))])[:, None])


def _slower(judged: Judged, trials: Trials) -> Conclusion:
    """How much slower the fish is at a wall than the same commands make it elsewhere."""
    slower = _relative(trials, -judged.coefficients[-1], judged.std[-1])
    found = judged.stands(SYMMETRY_GAIN, -1) and slower.value > 0.0
    text = f"at a wall the fish is {slower.value:.0%} slower than elsewhere"
    return found, text, {"slowdown": slower}


WALL_EFFECT = RegressionTest(
    "wall_effect",
    "physics",
    assumes=f"the walls are those of the pool, {LENGTH:g} m by {WIDTH:g} m about the origin",
    needs="three trials, near the walls and away from them at the same commands",
    lacking=_not_at_walls,
    rows=_walls,
    spanned="near walls commands differ from elsewhere",
    one_by_one=True,
    conclude=_slower,
)


def _patches(trial: StrokeMeans) -> Rows:
    """Terms (2C, 6): surge in proportion to the drive in each part of the pool."""
    x, y, _ = trial.pose.T
    columns = []
    for px, py in PATCHES:
        distance = np.hypot(x - px * LENGTH, y - py * WIDTH)
        inside = np.exp(-0.5 * (distance / PATCH_WIDTH) ** 2)
        columns.append(np.concatenate([inside * drive(trial), np.zeros(len(x))]))
    return _rows(trial, np.column_stack(columns))


def _faster(judged: Judged, trials: Trials) -> Conclusion:
    """The part of the pool in which the same commands make the fish slower or faster most clearly."""
    count = len(PATCHES)
    faster = [
        _relative(trials, c, s)
        for c, s in zip(judged.coefficients[-count:], judged.std[-count:], strict=True)
    ]
    best = int(np.argmax([abs(f.value) / max(f.std, 1e-9) for f in faster]))
    x, y = PATCHES[best][0] * LENGTH, PATCHES[best][1] * WIDTH
    parameters = {
        "faster": faster[best],
        "x": Estimate(x, PATCH_WIDTH, "m"),
        "y": Estimate(y, PATCH_WIDTH, "m"),
    }
    text = f"about ({x:.1f}, {y:.1f}) m the fish is {faster[best].value:+.0%} faster than elsewhere"
    return judged.stands(SYMMETRY_GAIN, best - count), text, parameters


PATCH = RegressionTest(
    "slower or faster in a part of the pool",
    "physics",
    assumes="commands alone drive the fish",
    needs="three trials over the pool at the same commands",
    lacking=_one_place,
    rows=_patches,
    spanned="parts of the pool were swum by other commands",
    one_by_one=True,
    conclude=_faster,
)
