# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""A name in the place of a law: where no name is significant and yet a law is left."""

from __future__ import annotations

from fish_sysid.diagnosis.cross_validation import gain_left_out, on_all
from fish_sysid.diagnosis.residual_regression import Law
from fish_sysid.diagnosis.result import Accepted, Round
from fish_sysid.diagnosis.significance import evidence, simplest, strength_z
from fish_sysid.diagnosis.task import Task
from fish_sysid.estimation.thresholds import FAIR_SHARE, SMALLEST_CHECK, SMALLEST_Z


def name_for_law(found: Round, law: Law, task: Task) -> tuple[Accepted, ...]:
    """The name that predicts every training trial from the others as well as the law that the nominal fit leaves.

    A law is called unexplained only if it predicts better than the names, which keep a fair share of their expected gain on
    all training trials; the two or three of the check determine so small a gain too poorly.
    """
    lawful, level = law.lawful(task.level), task.level
    if not lawful or not found.refitted:
        return ()
    training, tried = task.trials.training, len(found.ranking)
    base = on_all(found.base, training)
    needed = max(
        sum(law.gain[dof] for dof in lawful) - SMALLEST_CHECK,
        level.needed_unseen(law.samples, tried),
    )
    gains = {}
    for name, fit in found.refitted.items():
        gain, expected = gain_left_out(base, on_all(fit, training))
        if strength_z(fit, name) > SMALLEST_Z and gain > FAIR_SHARE * expected:
            gains[name] = gain
    good = {name: found.refitted[name] for name, nats in gains.items() if nats > needed}
    if not good:
        return ()
    name = simplest(max(good, key=lambda name: evidence(good[name])), good, level)
    task.progress(f"found {name} instead of a law: {gains[name]:.0f} nats on trials left out")
    return (Accepted(name, found, found.refitted, gains[name]),)
