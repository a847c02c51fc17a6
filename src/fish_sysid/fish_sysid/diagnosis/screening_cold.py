"""`ranking` where the model without the candidates leaves a force that no pool has: how far the camera leads each of them.

Such a base is so far from the truth that no path leads there from it, and at the noise that it needs the right name gains as
little as any. So all start at the nominal values, at usual water's noise, the IMU believed a hundredth at first: only the right
name leaves little then. A rudder 87 ms late, of which the other ranking saw nothing, gained 5600 nats so and the next name 1700.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

from fish_report.parallel import on_all_cores
from fish_sysid.dataset.experiment import Experiment, shorten
from fish_sysid.diagnosis.screening import (
    POLISHED,
    SCALE,
    Progress,
    Ranked,
    by_gain,
    distrusting,
    from_nominal,
    look_for,
    warm_starts,
)
from fish_sysid.estimation.annealed_fit import Stages, lead
from fish_sysid.estimation.ekf_types import Array, Noise
from fish_sysid.estimation.global_fit import FIRST_STEPS
from fish_sysid.estimation.map_fit import Fit, evaluate, log_posterior
from fish_sysid.estimation.parametrization import Hypothesis
from fish_sysid.estimation.sensor_noise import usual_noise

# as `tempering.LEADING`, with a third of the iterations, which lose 2 % of a right name's gain
STAGES: Stages = ((100.0, 8), (30.0, 6), (10.0, 6))


def rank_afar(
    base: Fit, names: Sequence[str], experiment: Experiment, progress: Progress
) -> tuple[Ranked, ...]:
    """All candidates and the base led by the camera on short trials; the IMU gains weight for the most promising ones."""
    short = shorten(experiment, FIRST_STEPS)
    noise = usual_noise(short)
    found = look_for(names, partial(look_led, noise=noise), base, short, progress)
    promising = sorted(names, key=lambda name: -found[name].objective)[:POLISHED]

    def further(name: str) -> Fit:
        fit = found[name]
        return led(fit.hypothesis, fit.theta, short, noise, STAGES[1:] if name in promising else ())

    ends = dict(zip(names, on_all_cores(further, names), strict=True))
    starts = (base.theta, from_nominal(base).theta)
    bases = on_all_cores(lambda theta: led(base.hypothesis, theta, short, noise, STAGES), starts)
    return by_gain(ends, max(fit.objective for fit in bases))


def look_led(base: Fit, name: str, short: Experiment, noise: Noise) -> Fit:
    """A candidate from the nominal values, strong or weak, as far as the camera alone leads."""
    hypothesis = base.hypothesis.with_effect(name, SCALE)
    wide = distrusting(noise, STAGES[0][0])
    starts = warm_starts(from_nominal(base), name, short, wide)
    start = max(starts, key=lambda theta: log_posterior(hypothesis, theta, short, wide))
    return lead(hypothesis, short, noise, start, STAGES[:1])


def led(
    hypothesis: Hypothesis, theta: Array, short: Experiment, noise: Noise, stages: Stages
) -> Fit:
    """From theta through these stages; at the last one's noise wherever the camera stopped, so that fits compare."""
    if stages:
        theta = lead(hypothesis, short, noise, theta, stages).theta
    return evaluate(hypothesis, theta, short, distrusting(noise, STAGES[-1][0]))
