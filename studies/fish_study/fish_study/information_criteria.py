# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""AIC, BIC and the smallest held-out error as competitors, over the tool's own refits of all candidates."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from fish_report.json_file import number
from fish_report.page import Table
from fish_sim.model import DT
from fish_study.score import Score
from fish_study.share import Share


def criterion_table(scores: Sequence[Score]) -> Table:
    """AIC and BIC over the tool's own quick refits of all candidates, on the same scenarios."""
    counted = [s for s in scores if not s.unnamed and len(s.truth) < 2]
    hidden = [s for s in counted if s.truth]
    nothing = [s for s in counted if s.scenario.group == "null" and s.ranking]
    rows = []
    for name, cost in (("AIC", aic_cost), ("BIC", bic_cost)):
        right = [choice(s, cost) in s.truth for s in hidden]
        alarms = [choice(s, cost) is not None for s in nothing]
        rows.append(
            [name, str(Share(sum(right), len(right))), str(Share(sum(alarms), len(alarms)))]
        )
    right = [smallest_error(s) in s.truth for s in hidden]
    alarms = [smallest_error(s) is not None for s in nothing if s.held_out]
    rows.append(
        [
            "smallest held-out error",
            str(Share(sum(right), len(right))),
            str(Share(sum(alarms), len(alarms))),
        ]
    )
    rows.insert(
        0,
        [
            "this tool",
            str(Share.of(hidden, lambda s: s.top1)),
            str(Share.of(nothing, lambda s: s.alarm)),
        ],
    )
    note = (
        "Scenarios with one hidden name, and nulls. AIC and BIC choose among the quick refits of all names on the search "
        "trials; the smallest held-out position error 2 s ahead among the refitted nominal model and the names refitted "
        "with their own noise: for this one nulls count where the tool refitted a name at all. In a scenario "
        "without an answer there are no fits to choose among: no method is right there, and such nulls do not count."
    )
    return Table("Competitors", ["method", "right name first", "false alarms"], rows, note)


def choice(score: Score, cost: Callable[[str, Score], float]) -> str | None:
    """The name with the best penalised likelihood; None if the nominal model has it, or nothing was ranked."""
    if not score.ranking:
        return None
    best = max(score.ranking, key=lambda n: score.ranking[n] - cost(n, score))
    return best if score.ranking[best] > cost(best, score) else None


def smallest_error(score: Score) -> str | None:
    """The refitted name that predicts best on trials held out; None if the refitted nominal model does."""
    nominal = number(score.rms.get("refitted", {}).get("2 s", {}).get("position_m"), np.inf)
    best = min(score.held_out, key=lambda n: score.held_out[n], default=None)
    return best if best is not None and score.held_out[best] < nominal else None


def aic_cost(name: str, score: Score) -> float:
    """Nats for the free parameters of a name."""
    return float(_free(name, score))


def bic_cost(name: str, score: Score) -> float:
    """Nats: half the logarithm of the number of measurements that the ranking saw, for each parameter."""
    from fish_sysid.estimation.thresholds import FIRST_STEPS, SEARCH_TRIALS

    scenario = score.scenario
    trials = min(SEARCH_TRIALS, scenario.count - scenario.count // 3)  # a third is held out
    seconds = min(scenario.duration, DT * FIRST_STEPS)
    samples = trials * seconds * (100.0 * (4 if scenario.encoder else 3) + 3 * 30.0)
    return 0.5 * _free(name, score) * float(np.log(samples))


def _free(name: str, score: Score) -> int:
    """Numbers of a name as its answer tells; of answers that do not, as it has them now."""
    from fish_sysid.estimation.parametrization import effect_class

    return score.free[name] if name in score.free else len(effect_class(name).parameters)
