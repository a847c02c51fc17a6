"""From fits to statements: what counts as significant, how probable each name is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import softmax
from scipy.stats import chi2, norm

from fish_sysid.estimation.map_fit import Fit
from fish_sysid.estimation.parametrization import effect_class, specification

# One nat of innovations is worth 1/TEMPER nats of evidence: model errors too small to have a name, and the search
# itself, make likelihood ratios over-confident. Set on the worlds of a finished study (docs/blind_studies.md, the fourth):
# where the model has the fish's number of tail links no wrong name gains more than 14 nats, hidden effects that the check
# confirms 34 and more; a fish of more links gives a wrong name up to 80, but not on the trials of the check.
TEMPER = 4.0
# nats per scalar measurement below which a gain is no physics worth a name, whatever its significance
SMALLEST_GAIN = 0.001
# nats that a name must gain on the trials of the check, however little it should
SMALLEST_CHECK = 10.0
SMALLEST_Z = 4.0  # standard errors between the strength and its neutral value
PLAUSIBLE = 0.02  # rivals less probable than this are not named


@dataclass(frozen=True)
class Level:
    """How much is enough: tolerated false alarms of the whole search."""

    false_alarms: float = 0.02

    def __post_init__(self) -> None:
        if not 0.0 < self.false_alarms < 0.5:
            raise ValueError(f"false_alarms: got {self.false_alarms}; expected a share in (0, 0.5)")

    def enough(self, samples: float, parameters: int, candidates: int) -> float:
        """Nats a candidate must gain: tempered likelihood-ratio test over all candidates, and not too small."""
        exact = 0.5 * float(chi2.isf(self.false_alarms / max(candidates, 1), parameters))
        return max(TEMPER * exact, SMALLEST_GAIN * samples)

    def enough_unseen(self, samples: float, tests: int) -> float:
        """Nats that a law chosen and fitted elsewhere must gain, tempered, and not too small: half of a name's.

        On one set of unseen trials the likelihood ratio of a law that is not true is 1 in the mean, so that it exceeds
        tests / false_alarms less often than false_alarms / tests (Markov's inequality; Gruenwald, de Heide and Koolen 2024).
        Summed over trials left out in turn, as here, that is no theorem: each of them has helped to fit what the others are
        foretold with, and the product of their ratios need not be 1 in the mean. There the number is an approximation, which
        `TEMPER` guards.
        """
        return max(TEMPER * float(np.log(tests / self.false_alarms)), 0.5 * SMALLEST_GAIN * samples)


def p_value(gain: float, parameters: int, candidates: int) -> float:
    """Of the tempered likelihood ratio, times the number of candidates tried (Bonferroni)."""
    return float(min(1.0, candidates * chi2.sf(2.0 * max(gain, 0.0) / TEMPER, parameters)))


def p_value_unseen(gain: float, candidates: int) -> float:
    """Of a tempered likelihood ratio on unseen data, times the number of candidates tried.

    A bound on one set of unseen trials, approximate where they were left out in turn: see `Level.enough_unseen`.
    """
    return float(min(1.0, candidates * np.exp(-max(gain, 0.0) / TEMPER)))


def probabilities(log_evidence: dict[str, float]) -> dict[str, float]:
    """Of competing hypotheses, equally probable beforehand."""
    odds = softmax(list(log_evidence.values()))
    return dict(zip(log_evidence, map(float, odds), strict=True))


def strength_z(fit: Fit, name: str) -> float:
    """Distance of an effect's strengths from neutral, in standard errors at the effect's own place.

    Of several strengths together: the number of standard errors of one that is as improbable as their Wald statistic. Each alone
    may be unsure while the sum of all is not: a vortex was found with 2700 nats, its eddies each within 2.7 standard errors.

    Where and when an effect acts is kept fixed: of a payload the data may tell the moment mass times place alone, so that
    its mass is uncertain beside its place, but not whether there is one.
    """
    effect = effect_class(name)
    places = [f"{name}.{key}" for key in effect.parameters if key not in effect.strength]
    kept = [i for i, free in enumerate(fit.hypothesis.free) if free not in places]
    own = [j for j, i in enumerate(kept) if fit.hypothesis.free[i].startswith(f"{name}.")]
    covariance = np.linalg.inv(fit.normal[np.ix_(kept, kept)])[np.ix_(own, own)]
    theta = fit.theta[kept][own]  # an effect's theta is 0 where it is neutral
    wald = float(theta @ np.linalg.solve(covariance, theta))
    return float(norm.isf(0.5 * max(chi2.sf(wald, len(own)), np.finfo(float).tiny)))


def parameter_count(name: str) -> int:
    """Free parameters of an effect."""
    return len(specification(name))
