"""The study's tables: one row per group, what was asked beside what came out, power, calibration, competitors."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from statsmodels.stats.proportion import proportion_confint

from fish_report.json_file import number
from fish_report.page import Table
from fish_sim.model import DT
from fish_study.scenario_groups import GROUPS
from fish_study.score import Score

CALIBRATION = (0.0, 0.5, 0.8, 0.95, 1.0)  # edges of the bins of stated probability


@dataclass(frozen=True)
class Share:
    """k of n with its exact (Clopper-Pearson) 95 % interval."""

    k: int
    n: int

    @classmethod
    def of(cls, scores: Iterable[Score], what: Callable[[Score], bool]) -> Share:
        """How many of the scores are so."""
        flags = [bool(what(s)) for s in scores]
        return cls(sum(flags), len(flags))

    @property
    def value(self) -> float:
        """K / n; NaN without any."""
        return self.k / self.n if self.n else float("nan")

    @property
    def interval(self) -> tuple[float, float]:
        """95 %."""
        if not self.n:
            return float("nan"), float("nan")
        low, high = proportion_confint(self.k, self.n, method="beta")
        return float(np.nan_to_num(low)), float(high)

    @property
    def short(self) -> str:
        """k/n alone."""
        return f"{self.k}/{self.n}" if self.n else "–"

    def __str__(self) -> str:
        if not self.n:
            return "–"
        low, high = self.interval
        return f"{self.k}/{self.n} = {self.value:.0%} ({low:.0%} to {high:.0%})"


@dataclass(frozen=True)
class Asked:
    """A number the project asks for, fixed before the run.

    A world without an answer is never right; what must not happen is counted among answers, which alone can do it.
    """

    what: str
    asked: str
    among: Callable[[Score], bool]
    is_so: Callable[[Score], bool]


def _one(s: Score) -> bool:
    """A single named effect at full strength and common noise."""
    return len(s.truth) == 1 and s.world.group in ("single", "sensor")


def _answers(group: str) -> Callable[[Score], bool]:
    """A world of this group to which the tool gave an answer."""
    return lambda s: s.world.group == group and s.has_answer


ASKED = (
    Asked("right name first, single effects", "at least 90 %", _one, lambda s: s.top1),
    Asked("truth in the answered set, single effects", "at least 98 %", _one, lambda s: s.in_set),
    Asked(
        "right name first, closed loop only",
        "at most 5 points below open loop",
        lambda s: s.world.group == "feedback",
        lambda s: s.top1,
    ),
    Asked("false alarms, nothing hidden", "at most 2 %", _answers("null"), lambda s: s.alarm),
    Asked(
        "both of two effects",
        "at least 75 %",
        lambda s: s.world.group == "two",
        lambda s: set(s.truth) <= set(s.named),
    ),
    Asked(
        "no false third name",
        "at least 95 %",
        lambda s: s.world.group == "two",
        lambda s: s.has_answer and not s.false_names,
    ),
    Asked(
        "no name exists: called unexplained",
        "at least 85 %",
        lambda s: s.unnamed and s.world.group == "outside",
        lambda s: s.verdict == "unexplained",
    ),
    Asked(
        "no name exists: wrong name with confidence",
        "at most 5 %",
        lambda s: s.unnamed and s.world.group == "outside" and s.has_answer,
        lambda s: s.confident_wrong,
    ),
    Asked(
        "sensor impostors called physics",
        "at most 3 %",
        _answers("sensor"),
        lambda s: s.called_physics,
    ),
)


def asked_table(scores: Sequence[Score]) -> Table:
    """What was asked, what came out."""
    rows = [[a.what, a.asked, str(Share.of(filter(a.among, scores), a.is_so))] for a in ASKED]
    sets = [len(s.answered) for s in scores if _one(s) and s.answered]
    rows.append(
        [
            "mean size of the answered set, single effects",
            "at most 1.5",
            f"{np.mean(sets):.2f}" if sets else "–",
        ]
    )
    errors = [p.within for s in scores if _one(s) and s.top1 for p in s.parameters]
    good = Share(sum(errors), len(errors))
    rows.append(["parameters within 3 standard errors or 20 %, right names", "all", str(good)])
    seconds = [s.seconds for s in scores]
    rows.append(
        [
            "seconds per data set, median (longest)",
            "180",
            f"{np.median(seconds):.0f} ({max(seconds):.0f})",
        ]
    )
    note = (
        "Thresholds were fixed before the run. Intervals: exact, 95 %. A world without an answer is not right, and no evidence "
        "that false alarms, confident wrong names or impostors called physics are few."
    )
    return Table("Asked and measured", ["what", "asked", "measured"], rows, note)


def group_table(scores: Sequence[Score]) -> Table:
    """One row per group."""
    header = [
        "group",
        "worlds",
        "right name first",
        "truth in set",
        "set size",
        "all right",
        "a false name",
        "alarm",
        "unexplained",
        "no answer",
        "s, median",
    ]
    rows = []
    for group in GROUPS:
        own = [s for s in scores if s.world.group == group]
        if not own:
            continue
        named = [s for s in own if s.truth]
        sizes = [len(s.answered) for s in own if s.answered]
        rows.append(
            [
                group,
                str(len(own)),
                Share.of(named, lambda s: s.top1).short,
                Share.of(named, lambda s: s.in_set).short,
                f"{np.mean(sizes):.2f}" if sizes else "–",
                Share.of(named, lambda s: s.exact).short,
                Share.of(own, lambda s: bool(s.false_names)).short,
                Share.of(own, lambda s: s.alarm).short,
                Share.of(own, lambda s: s.verdict == "unexplained").short,
                str(sum(not s.has_answer for s in own)),
                f"{np.median([s.seconds for s in own]):.0f}",
            ]
        )
    note = "; ".join(
        f"{name}: {(f.__doc__ or '').strip().rstrip('.')}" for name, f in GROUPS.items()
    )
    return Table("Groups", header, rows, note + ".")


def name_table(scores: Sequence[Score]) -> Table:
    """What was answered to each single hidden name."""
    rows = []
    for name in sorted({n for s in scores for n in s.world.names}):
        own = [s for s in scores if s.world.names == (name,)]
        answers = [", ".join(s.named) or s.verdict for s in own]
        if answers:
            counted = sorted(
                {a: answers.count(a) for a in answers}.items(), key=lambda item: -item[1]
            )
            rows.append([name, str(len(own)), "; ".join(f"{a} ({n})" for a, n in counted)])
    note = "All groups with one hidden thing, whatever its strength and noise."
    return Table("Answers by what was hidden", ["hidden", "worlds", "answers"], rows, note)


def failure_table(scores: Sequence[Score]) -> Table:
    """Worlds on which the tool gave no answer; they count as not right everywhere."""
    rows = [
        [s.world.group, ", ".join(s.world.names) or "nothing", " ".join(s.error.split())[:200]]
        for s in scores
        if not s.has_answer
    ]
    return Table(
        "No answer",
        ["group", "hidden", "what was said"],
        rows,
        "A world without an answer counts as not right.",
    )


@dataclass(frozen=True)
class Bin:
    """Answers whose first name was stated with a probability in [low, high)."""

    low: float
    high: float
    stated: float  # mean
    right: Share


def calibration(scores: Sequence[Score]) -> list[Bin]:
    """Stated probability of the first name against how often it is a hidden one."""
    bins = []
    for low, high in itertools.pairwise(CALIBRATION):
        own = [s for s in scores if s.named and low <= s.probability < high + (high == 1.0)]
        if own:
            mean = float(np.mean([s.probability for s in own]))
            bins.append(Bin(low, high, mean, Share.of(own, lambda s: s.top1)))
    return bins


def calibration_table(scores: Sequence[Score]) -> Table:
    """Bins and the Brier score."""
    rows = [
        [f"{b.low:g} to {b.high:g}", f"{b.stated:.2f}", str(b.right)] for b in calibration(scores)
    ]
    named = [s for s in scores if s.named]
    brier = np.mean([(s.probability - s.top1) ** 2 for s in named]) if named else float("nan")
    note = f"Over all worlds in which a name was given, whatever was hidden. Brier score {brier:.3f} (0 is best)."
    return Table(
        "Are the stated probabilities right?", ["stated", "mean", "first name right"], rows, note
    )


@dataclass(frozen=True)
class Power:
    """At one strength."""

    strength: float
    found: Share  # truth in the answered set
    oracle: Share | None


def power(scores: Sequence[Score], oracle: dict[int, bool] | None = None) -> list[Power]:
    """Over the ladder of strengths; oracle: seed of a world -> whether the test that knows the name sees it."""
    ladder = [s for s in scores if s.world.group == "ladder"]
    steps = []
    for strength in sorted({s.world.strength for s in ladder}):
        own = [s for s in ladder if s.world.strength == strength]
        seen = [oracle[s.world.seed] for s in own if s.world.seed in oracle] if oracle else []
        steps.append(
            Power(
                strength,
                Share.of(own, lambda s: s.in_set),
                Share(sum(seen), len(seen)) if seen else None,
            )
        )
    return steps


def power_table(steps: Sequence[Power]) -> Table:
    """Rows of the power curve."""
    rows = [[f"{p.strength:g}", str(p.found), str(p.oracle) if p.oracle else "–"] for p in steps]
    note = "Strength 1: as in the known data sets. Oracle: likelihood-ratio test of the true structure, which knows the name."
    return Table(
        "Detection power over strength",
        ["strength", "truth in the answered set", "oracle detects"],
        rows,
        note,
    )


def criterion_table(scores: Sequence[Score]) -> Table:
    """AIC and BIC over the tool's own quick refits of all candidates, on the same worlds."""
    judged = [s for s in scores if not s.unnamed and len(s.truth) < 2]
    hidden = [s for s in judged if s.truth]
    nothing = [s for s in judged if s.world.group == "null" and s.ranking]
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
        "Worlds with one hidden name, and nulls. AIC and BIC choose among the quick refits of all names on the search "
        "trials; the smallest held-out position error 2 s ahead among the refitted nominal model and the names refitted "
        "with their own noise: for this one nulls count where the tool refitted a name at all. In a world "
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

    world = score.world
    trials = min(SEARCH_TRIALS, world.count - world.count // 3)  # a third is held out
    seconds = min(world.duration, DT * FIRST_STEPS)
    samples = trials * seconds * (100.0 * (4 if world.encoder else 3) + 3 * 30.0)
    return 0.5 * _free(name, score) * float(np.log(samples))


def _free(name: str, score: Score) -> int:
    """Numbers of a name as its answer tells; of answers that do not, as it has them now."""
    from fish_sysid.estimation.parametrization import effect_class

    return score.free[name] if name in score.free else len(effect_class(name).parameters)
