# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Programs without a path: excitation, driving by hand, and the distance from walls."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from fish_control.excitation import (
    FASTEST_ROTOR,
    LAST_ROW,
    STOPPING,
    Excitation,
    Program,
    ProgramError,
    Row,
    command_table,
    read_program,
)
from fish_control.exciter import Exciter, Sight, heads_for_a_wall, stopping_rudder
from fish_control.line_of_sight import Motion
from fish_control.manual_drive import STEPS, ManualDrive
from fish_control.node_configs import ExciterConfig
from fish_control.paths import make_path
from fish_control.pool import (
    HALF_LENGTH,
    HALF_WIDTH,
    PathOutsidePoolError,
    check_inside_pool,
    stopping_side,
    stopping_turn,
    wall_distance,
)
from fish_control.watchdog import EstimateHealth

DT = 0.01
ROW = {"t": 0, "amplitude": 8, "frequency": 2, "rudder": 0.3}


def commands(excitation, seconds):
    return np.array([excitation.command(DT) for _ in range(round(seconds / DT))])


def test_the_rotor_oscillates_with_amplitude_and_frequency():
    """phi_dot = A w sin(w t + const): its root mean square is A w / sqrt 2, its phase grows by w t."""
    rows = commands(Excitation(Program((Row(0.0, 8.0, 1.5, 0.0),))), 6.0)[100:500]
    w = 2.0 * math.pi * 1.5
    assert np.sqrt(np.mean(rows[:, 1] ** 2)) == pytest.approx(8.0 * w / math.sqrt(2.0), rel=1e-3)
    np.testing.assert_allclose(np.diff(np.unwrap(rows[:, 0])), w * DT, rtol=1e-9)
    np.testing.assert_allclose(rows[:, 1], 8.0 * w * np.sin(rows[:, 0]), atol=1e-9)


def test_the_rudder_steps_when_the_rows_say():
    program = Program((Row(0.0, 0.0, 2.0, 0.1), Row(1.0, 0.0, 2.0, -0.4)))
    rudder = commands(Excitation(program), 2.0)[:, 2]
    np.testing.assert_allclose(rudder[:100], 0.1)
    np.testing.assert_allclose(rudder[101:], -0.4)


def test_the_rotor_s_speed_does_not_jump_between_rows():
    """It moves at most as the faster of two strokes does, plus what amplitude and frequency are allowed to change."""
    program = Program((Row(0.0, 8.0, 1.2, 0.0), Row(2.0, 6.0, 3.0, 0.0), Row(4.0, 0.0, 1.2, 0.0)))
    speed = commands(Excitation(program), program.duration + 1.0)[:, 1]
    w = 2.0 * math.pi * 3.0
    largest = 8.0 * w * w + 24.0 * w + 8.0 * 2.0 * math.pi * 4.0  # rad/s^2
    assert np.abs(np.diff(speed)).max() < largest * DT
    assert speed[-1] == 0.0


@pytest.mark.parametrize(
    ("slow", "fast"),
    [((24.0, 1.0), (6.0, 4.0)), ((120.0, 0.2), (6.0, 4.0)), ((48.0, 0.5), (12.0, 2.0))],
)
@pytest.mark.parametrize("accelerates", [True, False])
def test_between_two_rows_the_rotor_is_not_asked_for_more_than_a_row_may_ask(
    slow, fast, accelerates
):
    """Amplitude and frequency move at their own rates: the amplitude of one row meets the frequency of the other."""
    first, second = (slow, fast) if accelerates else (fast, slow)
    program = Program((Row(0.0, *first, 0.0), Row(12.0, *second, 0.0)))
    rows = commands(Excitation(program), program.duration + 1.0)
    assert 0.99 * FASTEST_ROTOR < np.abs(rows[:, 1]).max() <= FASTEST_ROTOR + 1e-9
    w = 2.0 * math.pi * fast[1]
    largest = (
        FASTEST_ROTOR * w + 24.0 * w + slow[0] * 2.0 * math.pi * 4.0
    )  # rad/s^2; and it does not jump
    assert np.abs(np.diff(rows[:, 1])).max() < largest * DT


def test_a_program_begins_in_the_middle_and_ends_at_rest():
    program = Program((Row(0.0, 8.0, 2.0, 0.2), Row(5.0, 8.0, 2.0, -0.2)))
    excitation = Excitation(program, begin=4.0, end=6.0)
    rows = commands(excitation, 4.0)
    assert excitation.over
    assert excitation.time == pytest.approx(6.0, abs=1.01 * DT)
    np.testing.assert_allclose(rows[[50, 150], 2], [0.2, -0.2])
    np.testing.assert_allclose(rows[-100:, 1:], 0.0)
    assert program.duration == 5.0 + LAST_ROW


def test_a_stopped_program_holds_its_rudder_until_the_fish_stands():
    excitation = Excitation(Program((Row(0.0, 8.0, 2.0, 0.0),)))
    commands(excitation, 2.0)
    excitation.stop(0.8)
    rows = commands(excitation, STOPPING + 1.0)
    assert excitation.over
    assert excitation.time == pytest.approx(2.0, abs=1.01 * DT)
    np.testing.assert_allclose(rows[: round(STOPPING / DT) - 1, 2], 0.8)
    np.testing.assert_allclose(rows[-90:, 1:], 0.0)
    assert np.abs(rows[60:, 1]).max() == 0.0  # the rotor is at rest within 0.6 s


@pytest.mark.parametrize(
    "wrap",
    [
        lambda rows: rows,
        lambda rows: {"program": rows},
        lambda rows: {"verdict": "x", "next_experiment": {"why": "y", "program": rows}},
    ],
)
@pytest.mark.parametrize("suffix", [".json", ".yaml"])
def test_a_program_is_read_alone_and_out_of_a_diagnosis(tmp_path, wrap, suffix):
    file = tmp_path / f"program{suffix}"
    file.write_text(json.dumps(wrap([ROW, {**ROW, "t": 4.5}])))
    assert read_program(file).rows == (Row(0.0, 8.0, 2.0, 0.3), Row(4.5, 8.0, 2.0, 0.3))


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("{", "is neither JSON nor YAML"),
        ("[" * 20_000, "is neither JSON nor YAML"),
        ('"words"', "holds str; expected a list of rows"),
        ("{}", "holds dict; expected a list of rows"),
        ("[]", "no rows"),
        ("[7]", "row 0 is 7; expected {t, amplitude, frequency, rudder}"),
        (json.dumps([{"t": 0, "amplitude": 1}]), "expected {t, amplitude, frequency, rudder}"),
        (
            json.dumps([{**ROW, "rudder": "left"}]),
            "row 0: rudder is 'left', expected a finite number",
        ),
        (
            json.dumps([{**ROW, "amplitude": 10**400}]),
            "expected a finite number",
        ),
        (
            json.dumps([{**ROW, "amplitude": float("nan")}]),
            "row 0: amplitude is nan, expected a finite number",
        ),
        (
            json.dumps([ROW, {**ROW, "rudder": 0.9, "t": 1}]),
            "row 1: rudder is 0.9 rad, expected -0.8 to 0.8 rad",
        ),
        (json.dumps([{**ROW, "frequency": 0}]), "row 0: frequency is 0 Hz, expected 0.1 to 4 Hz"),
        (json.dumps([{**ROW, "amplitude": 13}]), f"expected {FASTEST_ROTOR:.0f} rad/s at most"),
        (json.dumps([ROW, ROW]), "row 1: t is 0 s, expected more than the 0 s of the row before"),
    ],
)
def test_what_is_no_program_is_named(tmp_path, content, said):
    file = tmp_path / "program.json"
    file.write_text(content)
    with pytest.raises(ProgramError) as refusal:
        read_program(file)
    assert said in str(refusal.value)
    assert "program.json" in str(refusal.value)


@pytest.mark.parametrize(
    ("begin", "end"), [(-1.0, 5.0), (5.0, 5.0), (20.0, math.inf), (math.nan, 5.0)]
)
def test_an_empty_part_of_a_program_is_refused(begin, end):
    with pytest.raises(ProgramError, match="begin is"):
        Excitation(Program((Row(0.0, 8.0, 2.0, 0.0),)), begin, end)


def test_a_plan_ends_its_swims_where_it_says(tmp_path):
    file = tmp_path / "plan.json"
    rows = [{"t": t, "amplitude": 8, "frequency": 2, "rudder": 0.3} for t in (0, 6)]
    swims = [{"begin": 0, "end": 6, "what": "one"}, {"begin": 6, "end": 9, "what": "another"}]
    file.write_text(json.dumps({"program": rows, "swims": swims}))
    program = read_program(file)
    assert program.duration == 9.0
    assert [program.end_of_swim(t) for t in (0.0, 5.9, 6.0, 8.0)] == [6.0, 6.0, 9.0, 9.0]


@pytest.mark.parametrize(
    ("end", "said"),
    [
        (math.inf, "swim 1: end is inf, expected a finite number"),
        (math.nan, "swim 1: end is nan, expected a finite number"),
        (10**400, "expected a finite number"),
        (True, "swim 1: end is True, expected a finite number"),
        (1e9, "swim 1: end is 1e+09 s, expected more than 0 s and at most 7200 s"),
        (-1, "swim 1: end is -1 s, expected more than 0 s and at most 7200 s"),
    ],
)
def test_a_swim_that_ends_at_no_time_is_refused(tmp_path, end, said):
    file = tmp_path / "plan.json"
    file.write_text(json.dumps({"program": [ROW], "swims": [{"end": 8}, {"end": end}]}))
    with pytest.raises(ProgramError) as refusal:
        read_program(file)
    assert str(refusal.value).startswith(f"{file}: swim 1: end is ")
    assert said in str(refusal.value)


@pytest.mark.parametrize("end", [math.inf, math.nan, 1e9])
def test_a_program_has_an_end(end):
    with pytest.raises(ProgramError, match="swim 0: end is"):
        Program((Row(0.0, 8.0, 2.0, 0.3),), (end,))


@pytest.mark.parametrize("suffix", [".json", ".yaml"])
def test_of_two_values_of_one_name_none_is_chosen(tmp_path, suffix):
    file = tmp_path / f"program{suffix}"
    file.write_text(json.dumps([ROW]).replace('"rudder"', '"rudder": 0.8, "rudder"'))
    with pytest.raises(ProgramError, match=f"program{suffix}: rudder is given twice in .*; keep"):
        read_program(file)


@pytest.mark.parametrize("swims", [[{"end": 9}, {"end": 7}], [{"end": 5}], [{"begin": 0}], "all"])
def test_swims_that_end_in_no_order_are_refused(tmp_path, swims):
    file = tmp_path / "plan.json"
    rows = [{"t": t, "amplitude": 8, "frequency": 2, "rudder": 0.3} for t in (0, 6)]
    file.write_text(json.dumps({"program": rows, "swims": swims}))
    with pytest.raises(ProgramError, match="expected"):
        read_program(file)


def test_a_command_table_glides_after_its_end():
    table = command_table(Program((Row(0.0, 6.0, 2.0, 0.4),)), 0.0, 2.0, 3.0)
    assert table.shape == (500, 2)
    assert np.abs(table[:200, 1]).min() == 0.4
    assert np.abs(table[450:]).max() < 1e-9


SURE = EstimateHealth(0.01, True, 1e-5, 1e-4)
MIDDLE = Sight(Motion(0.0, 0.0, 0.0, 0.2, 0.0, 0.0), SURE)


def doubtful(**changes):
    return replace(MIDDLE, signs=replace(SURE, **changes))


def exciter(**parameters):
    config = ExciterConfig(rest=0.5, **parameters)
    return Exciter(config, Excitation(Program((Row(0.0, 8.0, 2.0, 0.3),)), 0.0, 2.0))


def swim(running, seconds, sight, begin=0.0):
    """Commands (T, 3) of a while: phase, rotor speed, rudder."""
    times = begin + DT * np.arange(round(seconds / DT))
    return np.array([running.command(float(t), DT, sight) for t in times])


def test_it_rests_swims_its_part_and_ends_at_rest():
    running = exciter()
    assert not swim(running, 1.0, None)[:, 1:].any()
    assert running.state == "waiting"
    assert not swim(running, 0.49, MIDDLE, begin=1.0)[:, 1:].any()
    assert running.reason == "at rest"
    strokes = swim(running, 1.99, MIDDLE, begin=1.5)
    assert running.reason == "swimming"
    assert strokes[-1, 2] == 0.3
    assert np.abs(strokes[:, 1]).max() > 60.0
    end = swim(running, 2.0, MIDDLE, begin=3.5)
    assert running.state == "ended"
    assert running.reason == "ended at 2.0 s, as programmed"
    assert not end[-10:, 1:].any()


def test_it_begins_when_the_robot_is_armed():
    running = exciter()
    for k in range(300):
        assert running.command(DT * k, DT, MIDDLE, "not armed since the start").rotor_speed == 0.0
    assert running.reason == "waiting for the robot to be armed: not armed since the start"
    assert not swim(running, 0.49, MIDDLE, begin=3.0)[:, 1:].any()
    assert np.abs(swim(running, 1.0, MIDDLE, begin=3.49)[:, 1]).max() > 60.0


def test_a_robot_that_is_disarmed_on_the_way_ends_the_swim_for_good():
    running = exciter()
    swim(running, 1.5, MIDDLE)
    running.command(1.5, DT, MIDDLE, "coil at 90 deg C")
    assert running.state == "disarmed"
    assert running.reason == "stopped at 1.0 s: disarmed: coil at 90 deg C"
    assert not swim(running, 4.0, MIDDLE, begin=1.51)[-10:, 1:].any()


@pytest.mark.parametrize(
    ("sight", "state", "said"),
    [
        (
            replace(MIDDLE, motion=Motion(HALF_LENGTH - 0.215, 0.0, 0.0, 0.2, 0.0, 0.0)),
            "before a wall",
            "at (1.92, 0.00) m",
        ),
        (doubtful(plausible=False), "lost", "odometry is not plausible"),
        (doubtful(age=0.6), "lost", "odometry is stale: 0.60 s old, 0.5 s allowed"),
        (doubtful(age=-5.0), "lost", "odometry is from the future: stamped 5.00 s ahead"),
        (doubtful(pose_variance=1e4), "lost", "camera lost"),
        (doubtful(twist_variance=1e4), "lost", "IMU lost"),
    ],
)
def test_a_reason_stops_it_for_good(sight, state, said):
    running = exciter()
    swim(running, 1.5, MIDDLE)
    held = swim(running, 0.02, sight, begin=1.5)[:, 2]
    assert abs(held[-1]) == (pytest.approx(0.8) if state == "before a wall" else 0.0)  # rad
    after = swim(running, 4.0, MIDDLE, begin=1.52)
    assert running.state == state
    assert running.reason.startswith("stopped at 1.0 s")
    assert said in running.reason
    assert not after[-10:, 1:].any()


def test_nothing_stops_it_before_it_swims_or_without_its_guard():
    running = exciter()
    swim(running, 0.4, doubtful(age=9.0))
    swim(running, 0.5, MIDDLE, begin=0.4)
    assert running.state == "swimming"
    blind = exciter(guard=False)
    swim(blind, 1.0, None)
    assert blind.state == "swimming"


@pytest.mark.parametrize(
    ("x", "y", "heading", "surge", "sway", "stopped"),
    [
        (HALF_LENGTH - 0.34, 0.0, 0.0, 0.2, 0.0, True),  # 0.14 m from the wall a second later
        (HALF_LENGTH - 0.36, 0.0, 0.0, 0.2, 0.0, False),
        (HALF_LENGTH - 0.34, 0.0, math.pi, 0.2, 0.0, False),  # away from it
        (
            HALF_LENGTH - 0.05,
            0.0,
            math.pi,
            0.05,
            0.0,
            False,
        ),  # put down near the wall, swimming away
        (HALF_LENGTH - 0.34, 0.0, math.pi / 2, 0.0, -0.2, True),  # sideways
        (0.0, HALF_WIDTH - 0.34, 0.0, 0.0, 0.2, True),
        (0.0, HALF_WIDTH - 0.34, 0.0, 0.0, -0.2, False),
        (
            0.0,
            HALF_WIDTH - 0.34,
            math.pi / 6,
            0.3,
            0.0,
            False,
        ),  # 0.15 m of the 0.3 m are towards the wall
        (
            0.0,
            HALF_WIDTH - 0.34,
            math.pi / 6,
            0.3,
            0.2 / math.sqrt(3.0),
            True,
        ),  # and 0.1 m more sideways
        (0.0, 0.0, 0.0, 0.3, 0.0, False),
    ],
)
def test_a_fish_that_heads_for_a_wall_is_seen(x, y, heading, surge, sway, stopped):
    assert (
        heads_for_a_wall(Motion(x, y, heading, surge, sway, 0.0), horizon=1.0, margin=0.15)
        is stopped
    )


def test_the_rudder_goes_to_the_side_with_more_room():
    motion = Motion(1.9, 0.4, 0.3, 0.2, 0.0, 0.0)
    rudder = stopping_rudder(motion, 0.8)
    distances = {side: wall_distance(stopping_turn(1.9, 0.4, 0.3, side)) for side in (-1.0, 1.0)}
    assert rudder == 0.8 * max(distances, key=distances.get)


def test_a_path_inside_passes_up_to_its_margin():
    path = make_path("circle", radius=0.9)
    check_inside_pool(path, 0.16)
    with pytest.raises(PathOutsidePoolError):
        check_inside_pool(path, 0.17)


def test_the_refusal_says_where_how_far_and_what_to_do():
    path = make_path("straight", length=4.2)
    with pytest.raises(PathOutsidePoolError) as refusal:
        check_inside_pool(path, 0.1)
    assert "straight" in str(refusal.value)
    assert "(-2.10, " in str(refusal.value)
    assert "|x| <= 2.035" in str(refusal.value)
    assert "make it smaller" in str(refusal.value)


def test_a_path_that_ends_towards_a_wall_needs_room_to_stop():
    """It ends at (-0.508, 0.855) m on course 2 rad; the turn's highest point is (1 + cos 2) 0.27 m above."""
    to_the_wall = {"length": 1.0, "course": 2.0, "x": -0.3, "y": 0.4}
    with pytest.raises(
        PathOutsidePoolError, match=r"ends so that .* fish comes to \(-0.7[3-7], 1.01\)"
    ):
        check_inside_pool(make_path("straight", **to_the_wall), 0.1)
    check_inside_pool(make_path("straight", **to_the_wall, end="loop"), 0.1)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_path_that_ends_beside_a_wall_is_passed_as_the_fish_stops_on_the_other_side(side):
    check_inside_pool(
        make_path("straight", length=1.0, course=np.pi / 2, x=side * 1.8, y=-0.2), 0.3
    )


def test_a_fish_stops_to_the_side_with_more_room():
    assert stopping_side(2.0, 0.0, 1.57) == 1.0  # towards +y, along the wall at +x: left
    assert stopping_side(-2.0, 0.0, 1.57) == -1.0
    assert (
        stopping_side(-0.7, -0.7, -1.97) == -1.0
    )  # down and back: the right turn leaves the wall at -y sooner


def test_the_stopping_turn_is_a_circle():
    turn = stopping_turn(0.1, 0.2, 0.0, 1.0)
    np.testing.assert_allclose(np.hypot(turn[:, 0] - 0.1, turn[:, 1] - 0.2 - 0.27), 0.27)
    np.testing.assert_allclose(turn[0], [0.1, 0.2])
    assert turn[1, 0] > 0.1


def driven_by_hand(drive, begin, seconds, hold=True):
    """Commands of 100 Hz (N, 2): rotor speed [rad/s], rudder [rad]."""
    rows = []
    for k in range(round(100 * seconds)):
        now = begin + 0.01 * k
        if hold:
            drive.hold(now)
        command = drive.command(now, 0.01)
        rows.append((command.rotor_speed, command.alpha))
    return np.array(rows)


def test_keys_change_throttle_and_rudder_in_steps():
    drive = ManualDrive(0.5)
    assert all(drive.press("up") for _ in range(3))
    assert drive.press("left")
    assert (drive.throttle, drive.rudder) == pytest.approx((3 / STEPS, 1 / STEPS))
    for _ in range(2 * STEPS):
        drive.press("down")
        drive.press("right")
    assert (drive.throttle, drive.rudder) == (0.0, -1.0)


def test_any_other_key_is_rest_at_once():
    drive = ManualDrive(0.5)
    drive.press("up")
    assert not drive.press(" ")
    assert (drive.throttle, drive.rudder) == (0.0, 0.0)


def test_a_held_deadman_swims_and_steers_left():
    drive = ManualDrive(0.5)
    drive.wish(0.5, 0.5)
    moved = driven_by_hand(drive, 0.0, 1.0)
    assert np.abs(moved[:, 0]).max() > 20.0
    assert moved[-1, 1] == pytest.approx(0.4)


def test_without_the_operator_it_comes_to_rest_within_time_out_and_run_down():
    drive = ManualDrive(0.3)
    drive.wish(1.0, 1.0)
    driven_by_hand(drive, 0.0, 1.0)
    silent = driven_by_hand(drive, 1.0, 1.0, hold=False)
    assert np.abs(silent[:25, 0]).max() > 20.0
    assert np.abs(silent[-10:]).max() == 0.0
    drive.hold(2.0)  # back again: from rest
    assert drive.command(2.0, 0.01).rotor_speed == 0.0


@pytest.mark.parametrize("wish", [(math.nan, math.nan), (math.inf, -math.inf)])
def test_what_is_no_number_is_rest(wish):
    drive = ManualDrive(0.5)
    drive.wish(*wish)
    assert (drive.throttle, drive.rudder) == (0.0, 0.0)


@pytest.mark.parametrize("timeout", [0.0, 10.0, math.nan])
def test_a_time_out_that_is_none_is_refused(timeout):
    with pytest.raises(ValueError, match=r"expected 0\.05 to 5 s"):
        ManualDrive(timeout)
