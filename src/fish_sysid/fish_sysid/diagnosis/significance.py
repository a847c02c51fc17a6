# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""From fits to statements: what counts as significant, how probable each name is."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.special import softmax
from scipy.stats import chi2, norm

from fish_sysid.estimation.map_fit import Fit, log_prior
from fish_sysid.estimation.thresholds import LOOK_ALIKES, SMALLEST_GAIN, TEMPER


@dataclass(frozen=True)
class Level:
    """How much is enough: tolerated false alarms of the whole search."""

    false_alarms: float = 0.02

    def __post_init__(self) -> None:
        if not 0.0 < self.false_alarms < 0.5:
            raise ValueError(f"false_alarms: got {self.false_alarms}; expected a share in (0, 0.5)")

    def needed(self, samples: float, parameters: int, candidates: int) -> float:
        """Nats a candidate must gain: tempered likelihood-ratio test over all candidates, and not too small."""
        exact = 0.5 * float(chi2.isf(self.false_alarms / max(candidates, 1), parameters))
        return max(TEMPER * exact, SMALLEST_GAIN * samples)

    def needed_unseen(self, samples: float, tests: int) -> float:
        """Nats that a law chosen and fitted elsewhere must gain, tempered, and not too small: half of a name's.

        On one set of unseen trials the likelihood ratio of a law that is not true is 1 in the mean, so that it exceeds
        tests / false_alarms less often than false_alarms / tests (Markov's inequality; Gruenwald, de Heide and Koolen 2024).
        Summed over trials left out in turn this is an approximation: each of them has helped to fit the others' predictions,
        so that the product of their ratios need not be 1 in the mean. TEMPER guards it.
        """
        return max(TEMPER * float(np.log(tests / self.false_alarms)), 0.5 * SMALLEST_GAIN * samples)


def p_value(gain: float, parameters: int, candidates: int) -> float:
    """Of the tempered likelihood ratio, times the number of candidates tried (Bonferroni)."""
    return float(min(1.0, candidates * chi2.sf(2.0 * max(gain, 0.0) / TEMPER, parameters)))


def evidence(fit: Fit, temper: float = 1.0) -> float:
    """Laplace approximation of the log evidence (MacKay 2003, ch. 27): an unneeded parameter costs its Occam factor.

    temper: nats of innovations that are worth one nat of evidence; the prior counts in full.
    """
    weight = 1.0 / fit.hypothesis.parametrization.prior**2
    prior = 0.5 * float(np.log(weight).sum()) + log_prior(fit.hypothesis, fit.theta)
    information = (fit.information - np.diag(weight)) / temper + np.diag(weight)
    occam = 0.5 * float(np.linalg.slogdet(information)[1])
    return float(fit.log_likelihood.sum()) / temper + prior - occam


def probabilities(fits: Mapping[str, Fit]) -> dict[str, float]:
    """Probability of every name, equally probable beforehand, the most probable first."""
    odds = softmax([evidence(fit, TEMPER) for fit in fits.values()]) if fits else []
    found = dict(zip(fits, map(float, odds), strict=True))
    return dict(sorted(found.items(), key=lambda item: -item[1]))


def look_alike(first: str, second: str) -> bool:
    """Two names that are easily taken for each other."""
    return any(first in group and second in group for group in LOOK_ALIKES)


def simplest(best: str, fits: Mapping[str, Fit], level: Level) -> str:
    """The best name, or a look-alike with fewer parameters that comes so near that the others are not worth having."""
    for name, fit in fits.items():
        extra = parameter_count(fits[best], best) - parameter_count(fit, name)
        if extra <= 0 or not look_alike(name, best):
            continue
        if fits[best].log_posterior - fit.log_posterior < level.needed(fit.samples, extra, 1):
            best = name
    return best


def parameter_count(fit: Fit, name: str) -> int:
    """Parameters of an effect."""
    return len(fit.hypothesis.effect(name).parameters)


def strength_z(fit: Fit, name: str) -> float:
    """Distance of an effect's strengths from neutral, in standard errors at the effect's own place.

    Of several strengths together: the number of standard errors of one that is as improbable as their Wald statistic. Each
    alone may be unsure while their sum is not.

    Where and when an effect acts is kept fixed: recordings may determine a payload's mass times its place alone, so that the
    mass is uncertain, but not whether there is one.
    """
    effect = fit.hypothesis.effect(name)
    places = [f"{name}.{key}" for key in effect.parameters if key not in effect.strength]
    kept = [i for i, free in enumerate(fit.hypothesis.free) if free not in places]
    own = [j for j, i in enumerate(kept) if fit.hypothesis.free[i].startswith(f"{name}.")]
    covariance = np.linalg.inv(fit.information[np.ix_(kept, kept)])[np.ix_(own, own)]
    theta = fit.theta[kept][own]  # 0 where the effect is neutral
    wald = float(theta @ np.linalg.solve(covariance, theta))
    return float(norm.isf(0.5 * max(chi2.sf(wald, len(own)), np.finfo(float).tiny)))
