# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Programs: what they command, and what they refuse."""

import json
import math

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
