"""How many links stand for the tail: a choice of the discretisation, so it competes with the candidates but is no name.

A tail that bends continuously, described by too few links, leaves a force behind that candidates would take up.
"""

from __future__ import annotations

from dataclasses import replace

from fish_sim.robot import MAX_LINKS, Robot, nominal_parameters
from fish_sysid.dataset.experiment import Experiment, shorten
from fish_sysid.diagnosis.cross_validation import gain_unseen, on_all
from fish_sysid.diagnosis.forward_selection import evidence
from fish_sysid.diagnosis.refit import carry_over, reheat
from fish_sysid.diagnosis.residual_regression import Description, describe
from fish_sysid.diagnosis.screening import Progress
from fish_sysid.diagnosis.significance import SMALLEST_CHECK, Level
from fish_sysid.diagnosis.trial_split import Trials
from fish_sysid.estimation.annealed_fit import TAIL_INERTIAS, fit_tempered
from fish_sysid.estimation.global_fit import (
    FIRST_STEPS,
    SUSPICIOUS,
    better,
    excess,
    fit_multistart,
)
from fish_sysid.estimation.map_fit import Fit
from fish_sysid.estimation.parametrization import nominal_hypothesis
from fish_sysid.estimation.sensor_noise import usual_noise

MORE = (1, 2)  # links that are tried beyond the robot's
LESS = 0.5  # of the water that the best fit leaves: the number of links beyond may be right


def with_links(robot: Robot, links: int) -> Robot:
    """The same fish with its tail cut into another number of equal links: totals and ratios to nominal values stay."""
    old, new = nominal_parameters(robot.links), nominal_parameters(links)
    values = {name: robot.parameters[name] * new[name].value / old[name].value for name in new}
    return replace(robot, links=links, parameters=values)


def finer_tail(
    nominal: Fit,
    best: Fit,
    law: Description,
    robot: Robot,
    trials: Trials,
    level: Level,
    progress: Progress,
) -> Fit | None:
    """The nominal model with more tail links, where the best fit leaves more than water or a law and this explains more of it.

    law: what the best leaves on all training trials. Those of the search alone may not show it: on a fish of four links they
    did not, and what was left was called unexplained (docs/blind_studies.md, the twenty-fifth).
    """
    experiment = trials.searched
    if (
        excess(best).max() < SUSPICIOUS
        and not law.lawful(level)
        and not describe(best, experiment).lawful(level)
    ):
        return None
    short = shorten(experiment, FIRST_STEPS)
    finer = max(
        finer_tails(robot, nominal, best, experiment, short, progress), key=evidence, default=None
    )
    if (
        finer is None
        or evidence(finer) < evidence(best)
        or excess(finer).max() > excess(best).max()
    ):
        return None
    gain = finer.objective - nominal.objective
    if gain < level.enough(float(nominal.result.samples.sum()), 1, len(MORE)):
        return None
    finer = reheat(finer, experiment)
    # half of what the truth would gain there is too much to ask: no number of links is the truth, and none is a name
    on_training = on_all(nominal, trials.training), on_all(finer, trials.training)
    if trials.check and not gain_unseen(*on_training, trials.check)[0] > SMALLEST_CHECK:
        return None
    progress(
        f"the tail needs {finer.robot.links} links: {finer.objective - nominal.objective:.0f} nats"
    )
    return finer


def finer_tails(
    robot: Robot,
    nominal: Fit,
    best: Fit,
    experiment: Experiment,
    short: Experiment,
    progress: Progress,
) -> list[Fit]:
    """Nominal models with more links, one after the other while they promise something.

    A tail that needs two links more gains by one already: 1200 and 8000 nats on two fish of five links (docs/blind_studies.md,
    after the tenth), if its optimum is found. So a fit from many places, the ratios to nominal values that fewer links came to
    among them, which goes on from the best only, competes with one led from these ratios all the way: on another fish of
    five links that was 1400 nats better with four, and the other no gain (ibid., the nineteenth). The better of the two came
    as far as `fit_cold` goes with its further ways (ibid., after the twentieth), but on two other fish not as far as fewer
    links: with four, held in its inertias until the IMU's full weight, 480 and 1800 nats farther (ibid., the twenty-third).
    All are led on shortened trials and judged on whole ones: there four links were 1700 nats ahead of three that they were
    1200 behind on the first seconds, and the held ones, ahead of both at first, 2500 behind (ibid.).
    """
    found, noise = [], usual_noise(short)
    for links in (robot.links + more for more in MORE):
        if links > MAX_LINKS:
            break
        progress(f"fitting the nominal model with {links} tail links")
        hypothesis = nominal_hypothesis(with_links(robot, links), nominal.hypothesis.free)
        many = fit_multistart(hypothesis, short, noise, places=(nominal.theta,))
        fit = carry_over(
            better(many, fit_tempered(hypothesis, short, noise, nominal.theta)), experiment
        )
        if not promises_more(fit, best):
            held = fit_tempered(hypothesis, short, noise, held=TAIL_INERTIAS)
            fit = better(fit, carry_over(held, experiment))
        found.append(fit)
        if not promises_more(fit, best):
            break
    return found


def promises_more(fit: Fit, best: Fit) -> bool:
    """Whether a finer tail explains more than the best fit, or leaves less than half of its water.

    Four links of a fish of five were 100 nats behind three with a quarter of their water, and five 6000 ahead
    (docs/blind_studies.md, the twenty-third). Of a fish of three that lacks what no name fits four leave 0.7 of it.
    """
    return fit.objective > best.objective or bool(LESS * excess(best).max() > excess(fit).max())
