# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Effects fitted together from the start, then taken out while trials left out are predicted as well without them.

Several things that a model lacks bend a fit that has none of them, and none of them helps such a fit alone. So what a fish's
body and actuators may have at all times and places is fitted at once, and each effect must then earn its place by trials left
out (`left_out`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from fish_report.parallel import on_all_cores
from fish_sysid.dataset.experiment import Experiment
from fish_sysid.estimation.shooting.fold_steps import FOLDS
from fish_sysid.estimation.shooting.left_out import Step, judged, left_out_costs, step_text
from fish_sysid.estimation.shooting.residuals import SENSORS
from fish_sysid.estimation.shooting.schedule import Found

Report = Callable[[str], None]

# no memory, no delay, no place in the pool
INTRINSIC = (
    "quadratic_drag",
    "tip_slip",
    "hull_asymmetry",
    "tail_hardening",
    "tail_joint_damping",
    "rotor_imbalance",
    "rudder_gain",
    "rudder_offset",
    "rudder_placement",
)


def eliminate(
    experiment: Experiment, found: Found, names: Sequence[str], report: Report = lambda _: None
) -> tuple[Found, tuple[Step, ...]]:
    """(the fit with those of `names` that trials left out ask for, what each of them does).

    The effect that gains least goes while one gains less than chance may let it gain (`standard_errors_asked`).
    """
    steps: dict[str, Step] = {}
    unsure = list(names) if len(experiment.names) >= FOLDS else []
    while unsure:
        report(f"leaving trials out, without {', '.join(unsure)} in turn")
        further, control = left_out_costs(experiment, found)
        fewer = [without(found, name) for name in unsure]
        tried = on_all_cores(lambda fit: left_out_costs(experiment, fit), fewer)
        fits = {}
        for name, (fits[name], costs) in zip(unsure, tried, strict=True):
            steps[name] = replace(judged(name, costs, control), added=True)
            report(f"{name}: {step_text(steps[name])}")
        unsure = [name for name in unsure if not steps[name].sure]
        if not unsure:
            return further, tuple(steps.values())
        worst = min(unsure, key=lambda name: steps[name].gain)
        found, steps[worst] = fits[worst], replace(steps[worst], added=False)
        unsure.remove(worst)
    return found, tuple(steps.values())


def without(found: Found, name: str) -> Found:
    """The fit less one effect, everything else as it is."""
    stays = np.concatenate([~found.hypothesis.own(name), np.ones(len(SENSORS), dtype=bool)])
    return replace(found, hypothesis=found.hypothesis.without(name), z=found.z[stays], cost=np.inf)
