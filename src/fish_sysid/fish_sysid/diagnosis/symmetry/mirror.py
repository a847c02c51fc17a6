# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Mirror symmetry: with the rudder mirrored, sway and yaw rate should be mirrored.

What breaks it is a trim of the rudder, an offset of the heading marker, a hull or a load that is not symmetric, or an uneven
tail. The test does not say which; every real fish breaks it a little. So alone it is not safe and names nothing.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fish_sysid.diagnosis.symmetry.galilei import asymmetric, block_diagonal, carried
from fish_sysid.diagnosis.symmetry.regression import Conclusion, Judged, RegressionTest, Rows
from fish_sysid.diagnosis.symmetry.stroke_means import StrokeMeans, Trials
from fish_sysid.estimation.thresholds import LEAST_SIDES, SYMMETRY_GAIN

Array = NDArray[np.float64]

ARM = 0.1  # m, times the yaw rate it is a speed like the sway: about half the head's length
SIDE = 0.2  # of stroke_means.RUDDER, a rudder that is to one side


def _one_side(trials: Trials) -> str:
    rudder = np.concatenate([s.rudder for s in trials])
    left, right = (float((sign * rudder > SIDE).mean()) for sign in (1.0, -1.0))
    text = f"the rudder is left in {left:.0%} and right in {right:.0%} of the time"
    return text if min(left, right) < LEAST_SIDES else ""


def _rows(trial: StrokeMeans) -> Rows:
    """Sway, then yaw rate: what is odd in the rudder and carried by the flow, against what is neither."""
    count, broken = len(trial.t), asymmetric(trial)
    flow = np.vstack([carried(trial)[count:], np.zeros((count, 2))])
    base = np.hstack([block_diagonal(trial.odd, trial.odd), flow])
    measured = np.concatenate([trial.velocity[:, 1], ARM * trial.velocity[:, 2]])
    return Rows(base, block_diagonal(broken, broken), measured)


def _differ(judged: Judged, _: Trials) -> Conclusion:
    """Whether sway and yaw rate have parts that do not change sign with the rudder."""
    sway, turn = judged.estimate(-6, "m/s"), judged.estimate(-3, "m/s")
    found = judged.stands(SYMMETRY_GAIN, *range(-6, 0))
    return found, "left and right turns differ", {"sway": sway, "yaw rate times 0.1 m": turn}


MIRROR = RegressionTest(
    "left and right differ",
    "physics",
    assumes="a mirror-symmetric fish, which none is quite: alone it is not safe and names nothing",
    needs="three trials with left and right turns, several speeds",
    stands_alone=False,
    lacking=_one_side,
    rows=_rows,
    spanned="one speed or too few headings",
    one_by_one=True,
    conclude=_differ,
)
