# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""How many links stand for the tail."""

from dataclasses import replace

import numpy as np
import pytest
from made_fits import made_fit
from swims import GIVEN, fish, swim

from fish_sysid.diagnosis.forward_selection import Selection
from fish_sysid.diagnosis.model_order import better_order, fit_links, promises_more, with_links
from fish_sysid.diagnosis.residual_regression import Law
from fish_sysid.diagnosis.result import Round
from fish_sysid.diagnosis.task import make_task
from fish_sysid.estimation.ekf_types import Noise
from fish_sysid.estimation.map_fit import evaluate
from fish_sysid.estimation.parametrization import nominal_hypothesis
from fish_sysid.estimation.refit import CONTINUE, refit

NO_LAW = Law({"surge": 0.0, "sway": 0.0, "yaw": 0.0}, {}, 1e4)


def test_a_tail_cut_finer_weighs_and_bends_as_before():
    coarse, fine = fish(3), with_links(fish(3), 5)
    for name in ("link_length", "link_mass", "link_drag_sway"):
        assert 5 * fine.parameters[name] == pytest.approx(3 * coarse.parameters[name])
    stiffness = coarse.parameters["tail_stiffness"] / 3
    assert fine.parameters["tail_stiffness"] / 5 == pytest.approx(stiffness)


def test_another_link_is_tried_where_this_number_explains_more_or_leaves_half_the_process_noise():
    best = made_fit(100.0, ratio=10.0)
    assert promises_more(made_fit(101.0, ratio=10.0), best)
    assert promises_more(made_fit(50.0, ratio=4.0), best)
    assert not promises_more(made_fit(50.0, ratio=6.0), best)


@pytest.mark.parametrize(("links", "needed"), [(2, 2), (1, None)])
def test_a_finer_tail_is_chosen_for_a_fish_that_has_one_and_for_no_other(links, needed):
    data = swim(fish(links), duration=4.0)
    task = make_task(data, GIVEN, names=("quadratic_drag",))
    hypothesis = nominal_hypothesis(GIVEN)
    origin = hypothesis.parametrization.origin()
    base = refit(hypothesis, origin, task.trials.searched, Noise(), CONTINUE)
    selection = Selection(base, (Round(base, (), {}),), ())
    found = better_order(selection, NO_LAW, task)
    assert (found and found.robot.links) == needed
    if needed:
        assert found.log_posterior > base.log_posterior + 100.0
        assert found.largest_ratio < base.largest_ratio


def test_parameters_of_the_robots_own_effects_stay_free_with_more_links():
    given = GIVEN.with_effect("rudder_offset", offset=0.05)
    data = swim(fish(rudder_offset={"offset": 0.05}), kinds=("sines",), duration=1.0)
    task = make_task(data, given, names=("quadratic_drag",))
    free = ("tail_stiffness", "rudder_offset.offset")
    hypothesis = replace(nominal_hypothesis(given, free[:1]), free=free)
    nominal = evaluate(hypothesis, np.zeros(2), data, Noise())
    assert fit_links(2, nominal, nominal, task).hypothesis.free == free
