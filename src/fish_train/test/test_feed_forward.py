# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Feed-forward measured on what swims: against the equations, against swims of its own, and without what is the pool's."""

from dataclasses import asdict, replace

import numpy as np
import pytest

from fish_control.control_law import ControlLimits, feedforward_throttle
from fish_control.line_of_sight import GuidanceConfig, slip_lever
from fish_sim.robot import Robot
from fish_train.evaluation import feed_forward
from fish_train.evaluation.feed_forward import (
    DoesNotSwim,
    SteadySwim,
    fitted_law,
    law_of_plant,
    law_of_robot,
    steady_swims,
)
from fish_train.evaluation.plant import FishSimPlant
from fish_train.training.closed_loop_equations import Law

LIMITS = ControlLimits(
    curvature_gain=0.3,
    throttle_linear=0.7,
    throttle_quadratic=5.0,
    turn_linear=2.0,
    turn_quadratic=6.0,
)
GUIDANCE = GuidanceConfig(slip_arm=0.1, slip_time=0.3)
HEAVY = Robot().with_parameters(head_drag_surge=0.5)


def constants(law: Law) -> dict[str, float]:
    return {**asdict(law.limits), **asdict(law.guidance)}


def swims(limits: ControlLimits, guidance: GuidanceConfig) -> SteadySwim:
    """Of a fish that obeys the law's equations."""
    u, alpha = (a.ravel() for a in np.meshgrid([0.08, 0.15, 0.25], [0.0, 0.2, -0.2, 0.4, -0.4]))
    kappa = alpha / limits.curvature_gain
    slip = -slip_lever(u, guidance) * u * kappa
    return SteadySwim(feedforward_throttle(u, alpha, limits), alpha, u, slip, u * kappa)


def test_a_fish_that_obeys_the_equations_gives_their_constants() -> None:
    found = fitted_law(swims(LIMITS, GUIDANCE), Law())
    assert constants(found) == pytest.approx(constants(Law(limits=LIMITS, guidance=GUIDANCE)))


def test_what_is_not_measured_stays() -> None:
    law = Law(limits=ControlLimits(derivative_time=0.4), guidance=GuidanceConfig(listen_time=1.0))
    found = fitted_law(swims(LIMITS, GUIDANCE), law)
    assert (found.limits.derivative_time, found.guidance.listen_time) == (0.4, 1.0)


def test_the_nominal_fish_has_the_laws_own_constants() -> None:
    """The defaults were fitted by hand on other swims: the throttle to 0.05, the others to a tenth."""
    found, law = law_of_robot(Robot()), Law()
    for u in (0.1, 0.2, 0.3):
        for alpha in (0.0, 0.3):
            own, given = (feedforward_throttle(u, alpha, each.limits) for each in (found, law))
            assert own == pytest.approx(given, abs=0.05)
        assert slip_lever(u, found.guidance) == pytest.approx(slip_lever(u, law.guidance), rel=0.1)
    assert found.limits.curvature_gain == pytest.approx(law.limits.curvature_gain, rel=0.1)


def test_a_robot_swims_at_the_speed_that_its_own_feed_forward_says() -> None:
    """Throttles and rudders that were not among those measured."""
    law = law_of_robot(HEAVY)
    wanted = [(0.12, 0.0), (0.2, 0.0), (0.15, 0.25)]
    rows = [(float(feedforward_throttle(u, alpha, law.limits)), alpha) for u, alpha in wanted]
    swum = steady_swims(FishSimPlant([HEAVY] * 6, range(6)), rows, law.limits)
    assert swum.surge == pytest.approx([u for u, _ in wanted], abs=0.01)
    nominal = [float(feedforward_throttle(u, alpha, Law().limits)) for u, alpha in wanted]
    assert all(own > 1.3 * other for (own, _), other in zip(rows, nominal, strict=True))
    assert swum.yaw_rate[2] / swum.surge[2] == pytest.approx(
        0.25 / law.limits.curvature_gain, rel=0.15
    )


def test_the_water_of_the_pool_is_no_part_of_the_robot() -> None:
    there = HEAVY.with_effect("current", x=0.03, y=-0.02).with_effect(
        "wall_effect", k=2.5, length=0.2
    )
    assert constants(law_of_robot(there)) == constants(law_of_robot(HEAVY))
    # a plant whose water flows cannot be asked to stop it: two opposite headings tell the current from the fish
    flowing = HEAVY.with_effect("current", x=0.03, y=-0.02)
    found = law_of_plant(lambda count: FishSimPlant([flowing] * count, range(count)))
    for u in (0.1, 0.2):
        assert feedforward_throttle(u, 0.0, found.limits) == pytest.approx(
            feedforward_throttle(u, 0.0, law_of_robot(HEAVY).limits), rel=0.05
        )


def test_what_does_not_swim_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    good = swims(LIMITS, GUIDANCE)
    with pytest.raises(DoesNotSwim, match="expected all above 0"):
        fitted_law(replace(good, surge=-good.surge), Law())
    with pytest.raises(DoesNotSwim, match="expected all above 0"):
        fitted_law(replace(good, surge=np.full_like(good.surge, np.nan)), Law())
    with pytest.raises(DoesNotSwim, match="a rudder to the left turns to the right"):
        fitted_law(replace(good, yaw_rate=-good.yaw_rate), Law())
    monkeypatch.setattr(feed_forward, "SETTLING", 1.0)
    with pytest.raises(DoesNotSwim):
        law_of_robot(Robot().with_parameters(head_drag_surge=1000.0))
