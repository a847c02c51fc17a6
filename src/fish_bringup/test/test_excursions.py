"""A program cut into swims: all of it, and every one inside the pool."""

import numpy as np
import pytest

from fish_bringup.excursions import (
    MARGIN,
    SHORTEST,
    excursions,
    predicted_way,
)
from fish_control.excitation import Program, ProgramError, Row
from fish_control.pool import wall_distance
from fish_sim.robot import Robot
from fish_sysid.diagnosis.next_experiment import PLANS, RUDDER_STEPS, STRAIGHT_STEPS

EVERY_PLAN = list(
    {id(plan): plan for plan in (*PLANS.values(), STRAIGHT_STEPS, RUDDER_STEPS)}.values()
)


@pytest.mark.parametrize("plan", EVERY_PLAN, ids=lambda plan: plan[0].split(":")[0])
def test_every_experiment_that_a_diagnosis_proposes_can_be_swum_in_the_pool(plan):
    program, robot = Program(tuple(Row(*map(float, row)) for row in plan[1])), Robot()
    swims = list(excursions(program, robot))
    assert swims[0].begin == 0.0
    assert program.duration - swims[-1].end < SHORTEST
    assert [s.begin for s in swims[1:]] == [s.end for s in swims[:-1]]
    for swim in swims:
        way = predicted_way(program, swim.begin, swim.end, robot)[:, :2]
        cos, sin = np.cos(swim.heading), np.sin(swim.heading)
        there = way @ np.array([[cos, sin], [-sin, cos]]) + [swim.x, swim.y]
        assert wall_distance(there) >= MARGIN - 1e-6
        assert np.ptp(there, axis=0).max() > 0.2  # it swims


def test_a_program_that_needs_more_room_than_there_is_is_refused(monkeypatch):
    monkeypatch.setattr("fish_bringup.excursions.MARGIN", 1.06)
    program = Program((Row(0.0, 12.0, 2.0, 0.0),))
    with pytest.raises(ProgramError, match=r"more room within 3 s than the pool has with 1.06 m"):
        list(excursions(program, Robot()))
