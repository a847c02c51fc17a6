# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""A program cut into swims: all of it, and every one inside the pool."""

from functools import partial

import numpy as np
import pytest

from fish_control.excitation import Program, ProgramError, Row, command_table
from fish_control.excursions import COAST, MARGIN, SHORTEST, excursions, next_begin
from fish_control.pool import wall_distance
from fish_sim.robot import Robot
from fish_sim.way import way_from_rest
from fish_sysid.diagnosis.next_experiment import PLANS, RUDDER_STEPS, STRAIGHT_STEPS

WAY = partial(way_from_rest, Robot())
EVERY_PLAN = list(
    {id(plan): plan for plan in (*PLANS.values(), STRAIGHT_STEPS, RUDDER_STEPS)}.values()
)


@pytest.mark.parametrize("plan", EVERY_PLAN, ids=lambda plan: plan[0].split(":")[0])
def test_every_experiment_that_a_diagnosis_proposes_can_be_swum_in_the_pool(plan):
    program = Program(tuple(Row(*map(float, row)) for row in plan[1]))
    swims = list(excursions(program, WAY))
    assert swims[0].begin == 0.0
    assert program.duration - swims[-1].end < SHORTEST
    assert [s.begin for s in swims[1:]] == [s.end for s in swims[:-1]]
    for swim in swims:
        way = WAY(command_table(program, swim.begin, swim.end, COAST))[:, :2]
        cos, sin = np.cos(swim.heading), np.sin(swim.heading)
        there = way @ np.array([[cos, sin], [-sin, cos]]) + [swim.x, swim.y]
        assert wall_distance(there) >= MARGIN - 1e-6
        assert np.ptp(there, axis=0).max() > 0.2  # it swims


def test_a_program_that_needs_more_room_than_there_is_is_refused():
    program = Program((Row(0.0, 12.0, 2.0, 0.0),))
    with pytest.raises(ProgramError, match=r"more room within 3 s than the pool has with 1.06 m"):
        list(excursions(program, WAY, margin=1.06))


def test_the_swims_of_a_plan_end_where_the_plan_says():
    rows = (Row(0.0, 5.0, 2.0, 0.4), Row(5.0, 5.0, 2.0, -0.4), Row(9.0, 8.0, 2.0, 0.4))
    swims = list(excursions(Program(rows, (5.0, 9.0, 15.0)), WAY))
    assert [(s.begin, s.end) for s in swims] == [(0.0, 5.0), (5.0, 9.0), (9.0, 15.0)]


@pytest.mark.parametrize(("reached", "begin"), [(3.0, 5.0), (2.0, 2.0), (5.0, 5.0), (13.0, 13.0)])
def test_what_is_too_short_for_a_swim_of_its_own_is_left_out(reached, begin):
    program = Program((Row(0.0, 5.0, 2.0, 0.4),), (5.0, 15.0))
    assert next_begin(program, reached) == begin
