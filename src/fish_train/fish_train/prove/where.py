"""Where localised effects really act, and how well an answer's times and covariates agree with that."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fish_sim.pool import LENGTH, WIDTH
from fish_train.prove.trials import PERIOD
from fish_train.prove.world import World

Array = NDArray[np.float64]

STROKE = 50  # grid points of 10 ms, over which speeds are averaged
ACTIVE = 0.3  # of the largest activity, from which an effect counts as acting


def covariates(truth: Array) -> dict[str, Array]:
    """What an answer may speak about, from true poses (T, M, 3); (T, M) each."""
    x, y, heading = truth[..., 0], truth[..., 1], truth[..., 2]
    vx, vy = (np.gradient(a, PERIOD, axis=0) for a in (x, y))
    cos, sin = np.cos(heading), np.sin(heading)
    wall = np.minimum(LENGTH / 2 - np.abs(x), WIDTH / 2 - np.abs(y))
    return {
        "surge_speed": vx * cos + vy * sin,
        "sway_speed": vy * cos - vx * sin,
        "yaw_rate": np.gradient(heading, PERIOD, axis=0),
        "wall_distance": wall,
        "heading": np.arctan2(sin, cos),
        "x": x,
        "y": y,
    }


def activity(world: World, truth: Array) -> tuple[str, Array] | None:
    """(covariate that rules it, how strongly it acts (T, M)) of a world's only effect, if that acts here and not there."""
    if len(world.effects) != 1:
        return None
    (name, p), c = next(iter(world.effects.items())), covariates(truth)
    speed = np.hypot(c["surge_speed"], c["sway_speed"])
    if name == "wall_effect":
        return "wall_distance", speed * np.exp(-np.maximum(c["wall_distance"], 0.0) / p["length"])
    if name == "wave_drag":
        return "surge_speed", np.exp(-0.5 * ((np.abs(c["surge_speed"]) - p["speed"]) / p["width"]) ** 2)
    if name == "tether":
        return "", np.maximum(np.hypot(c["x"] - p["x"], c["y"] - p["y"]) - p["length"], 0.0)
    if name == "jet":
        squared = (c["x"] - p["at_x"]) ** 2 + (c["y"] - p["at_y"]) ** 2
        return "", np.exp(-squared / (2.0 * p["width"] ** 2))
    return None


def dof_overlap(stated: Mapping[str, float], true: Mapping[str, float]) -> float:
    """1 where two sets of shares over the degrees of freedom are equal, 0 where they have nothing in common."""
    return float(sum(min(share, true.get(name, 0.0)) for name, share in stated.items()))


def time_overlap(stated: Sequence[Mapping[str, Any]], names: Sequence[str], acts: Array) -> float:
    """Intersection over union, in time, of the windows stated and as many of the strongest true ones.

    acts (T, M): activity on the trials `names`. The windows compete on the grid of the longest stated window.
    """
    if not stated:
        return float("nan")
    length = max(round((w["to"] - w["from"]) / PERIOD) for w in stated)
    grid = [(m, k) for m in range(len(names)) for k in range(0, len(acts), length)]
    strength = [float(acts[k : k + length, m].sum()) for m, k in grid]
    best = {grid[i] for i in np.argsort(strength)[::-1][: len(stated)]}
    said, true = np.zeros(acts.shape, dtype=bool), np.zeros(acts.shape, dtype=bool)
    for w in stated:
        if w["trial"] in names:
            said[round(w["from"] / PERIOD) : round(w["to"] / PERIOD), list(names).index(w["trial"])] = True
    for m, k in best:
        true[k : k + length, m] = True
    return float((said & true).sum() / (said | true).sum())


def regime_f1(stated: Sequence[Mapping[str, Any]], truth: Array, acts: Array) -> float:
    """F1 over samples: inside the range of the first covariate stated, against activity above ACTIVE of its maximum."""
    c = covariates(truth)
    known = [s for s in stated if s["name"] in c]
    if not known:
        return float("nan")
    low, high = known[0]["range"]
    value = c[known[0]["name"]]
    said, true = (value >= low) & (value <= high), acts > ACTIVE * acts.max()
    both = float((said & true).sum())
    return 2.0 * both / float(said.sum() + true.sum()) if said.any() or true.any() else float("nan")
