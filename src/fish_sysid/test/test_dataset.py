# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""A data set on one grid: clocks, gaps, rest, the IMU, the marker."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from swims import World, kinematic_swims

from fish_sim.model import DT
from fish_sim.robot import Robot
from fish_sysid.dataset.camera import (
    DELAYS,
    ahead_of,
    align,
    at_centre_of_mass,
    forward,
    misfits,
    moved_back,
    with_marker,
)
from fish_sysid.dataset.commands import (
    LostCommandsError,
    commands_on_grid,
    driven,
    held_rudder,
    holes,
    standing,
)
from fish_sysid.dataset.experiment import Experiment, Frames, Headings
from fish_sysid.dataset.grid import apart, in_holes, level, on_grid, starts_at_rest
from fish_sysid.dataset.imu import WINDOW, imu_moved_back, orientation_windows
from fish_sysid.dataset.synthetic import FULL_SPEED, KINDS, STROKE, program, record, with_gyro_scale
from fish_sysid.diagnosis.task import make_task
from fish_sysid.diagnosis.vocabulary import known_effects
from fish_sysid.estimation.ekf_types import Noise
from fish_sysid.estimation.map_fit import evaluate
from fish_sysid.estimation.parametrization import nominal_hypothesis
from fish_sysid.identification_statements import incomplete


def experiment_with_delay(delay: float) -> Experiment:
    random = np.random.default_rng(3)
    commands = np.stack([program(kind, 12.0, random) for kind in ("sines", "random")], axis=1)
    made = record(Robot(), commands, Noise(), random)[0]
    frames = tuple(Frames(f.t + delay, f.pose) for f in made.frames)
    return Experiment(**{**vars(made), "frames": frames})


@pytest.mark.parametrize("delay", [0.0, 0.05, 0.49, 0.7])
def test_delay_of_the_camera_comes_back_even_beyond_a_stroke(delay: float) -> None:
    assert align(experiment_with_delay(delay)).delay == pytest.approx(delay, abs=0.011)


def test_the_delay_is_the_nearest_of_those_that_are_tried() -> None:
    """A sum of samples is the integral up to half a step after the last one; taken for a whole step it costs 5 ms."""
    found = [align(experiment_with_delay(delay)).delay for delay in (0.122, 0.128)]
    assert found == pytest.approx([0.12, 0.13])


@pytest.mark.parametrize("delay", [0.02, 1.1])
def test_a_delay_below_a_frame_or_beyond_what_is_looked_for_is_not_stated(delay: float) -> None:
    """The first is left to the filter; the best of all that were tried is not the delay where it is the last of them."""
    assert align(experiment_with_delay(delay)).delay == 0.0


def test_without_a_gyro_no_delay_is_stated() -> None:
    late = experiment_with_delay(0.3)
    blind = Experiment(**{**vars(late), "gyro": np.full_like(late.gyro, np.nan)})
    assert align(blind).delay == 0.0


def test_windows_in_which_the_gyro_says_nothing_are_left_out() -> None:
    """The first sample held over a gyro's late start or a hole is a turn that the fish did not make."""
    late = experiment_with_delay(0.3)
    gyro = late.gyro.copy()
    gyro[:130], gyro[130] = np.nan, 5.0
    gyro[700:760, 1] = np.nan
    holed = Experiment(**{**vars(late), "gyro": gyro})
    whole, _ = misfits(late)
    rest, count = misfits(holed)
    best = DELAYS[np.nanargmin(np.nansum(rest * count[:, None], axis=0))]
    assert best == pytest.approx(0.3, abs=0.011)
    assert np.nanmin(rest) < 2.0 * whole.min()
    assert count.tolist() == [1, 0]


def test_images_move_back_and_those_before_the_start_go() -> None:
    late = experiment_with_delay(0.3)
    back = moved_back(late, 0.5)
    assert back.frames[0].t[0] >= 0.0
    assert len(late.frames[0].t) - len(back.frames[0].t) == pytest.approx(
        6, abs=1
    )  # 0.2 s at 30 Hz


def test_gravity_of_a_rolling_imu_is_taken_out() -> None:
    roll, yaw = 0.1 * np.sin(np.linspace(0.0, 6.0, 50)), 0.7
    half_roll, half_yaw = 0.5 * roll, 0.5 * yaw
    quaternion = np.column_stack(
        [  # yaw, then roll about the new x axis
            np.cos(half_yaw) * np.sin(half_roll),
            np.sin(half_yaw) * np.sin(half_roll),
            np.sin(half_yaw) * np.cos(half_roll),
            np.cos(half_yaw) * np.cos(half_roll),
        ]
    )
    left, up, r = 0.4, 9.81, 1.5
    accel = np.column_stack(
        [
            np.full(50, 0.2),
            left * np.cos(roll) + up * np.sin(roll),
            up * np.cos(roll) - left * np.sin(roll),
        ]
    )
    gyro = np.column_stack([np.zeros(50), r * np.sin(roll), r * np.cos(roll)])
    rate, force = level(SimpleNamespace(gyro=gyro, accel=accel, orientation=quaternion))  # type: ignore[arg-type]
    np.testing.assert_allclose(rate, r, atol=1e-12)
    np.testing.assert_allclose(force, np.tile([0.2, left], (50, 1)), atol=1e-12)


def test_encoder_replaces_a_command_that_stands_while_the_rotor_runs_down() -> None:
    t = 0.01 * np.arange(400)
    command = np.where(t < 2.0, 50.0 * np.sin(12.0 * t), 40.0)
    encoder = np.where(t < 2.0, command, 40.0 * np.exp(-(t - 2.0)))
    encoder[1::3] = np.nan
    speed, left = driven(command, encoder)
    assert standing(command) == [(200, 400)]
    np.testing.assert_array_equal(speed[:200], command[:200])
    np.testing.assert_allclose(speed[200:397], 40.0 * np.exp(-(t[201:398] - 2.0)), atol=0.01)
    assert np.isnan(left[201:]).all()
    assert np.isfinite(left[:201]).any()


def test_a_rotor_that_the_encoder_drives_moves_as_the_encoder_measured() -> None:
    """At every grid point, also at the first and the last of two forgotten commands."""
    random, k = np.random.default_rng(5), np.arange(300)
    given = 50.0 * np.sin(0.12 * k)
    given[80:150], given[200:] = 30.0, 40.0
    followed = np.where((k >= 80) & (k < 150), 30.0 * np.exp(-0.02 * (k - 80)), given)
    followed[200:] = 40.0 * np.exp(-0.01 * (k[200:] - 200))

    def rotor(command: np.ndarray) -> np.ndarray:
        """(T,) speed of the model's rotor."""
        told = np.stack([command, 0.0 * command], axis=-1)[:, None]
        return record(Robot(), told, Noise(encoder=0.0), random)[0].encoder[:, 0]

    encoder = rotor(followed)
    speed, left = driven(given, encoder)
    np.testing.assert_allclose(rotor(speed), encoder, atol=1e-9)
    assert np.flatnonzero(np.isnan(left)).tolist() == [*range(81, 151), *range(201, 300)]


@pytest.mark.parametrize(("apart", "replaced"), [(4.0, False), (6.0, True), (-6.0, True)])
def test_a_constant_command_stays_as_long_as_the_rotor_follows_it(
    apart: float, replaced: bool
) -> None:
    command = np.full(200, 40.0)
    speed, left = driven(command, command + apart)
    np.testing.assert_array_equal(speed, command + apart if replaced else command)
    assert np.isfinite(left[1:]).any() != replaced


def test_a_rotor_that_is_told_to_stand_runs_down_in_the_model() -> None:
    command, encoder = np.zeros(300), 40.0 * np.exp(-0.01 * np.arange(300))
    speed, left = driven(command, encoder)
    assert not speed.any()
    assert np.array_equal(left, encoder)


def test_half_a_second_of_the_same_command_is_no_forgotten_one() -> None:
    command = np.r_[np.full(50, 20.0), np.full(51, 30.0)]
    assert standing(command) == [(50, 101)]


GRID = DT * np.arange(400)
TOLD = np.column_stack([60.0 * np.sin(4.0 * np.pi * GRID), 0.4 * np.sin(2.0 * GRID)])
SILENT = np.full(len(GRID), np.nan)
PEAK = 112  # the rotor's speed turns in the middle of the holes that begin here


def without(first: int, count: int) -> np.ndarray:
    return np.delete(np.arange(len(GRID)), np.arange(first, first + count))


@pytest.fixture(scope="module")
def swum() -> Experiment:
    random = np.random.default_rng(1)
    commands = np.stack([program(kind, 5.0, random) for kind in ("steps", "random")], axis=1)
    return record(Robot(), commands, Noise(), random)[0]


def losing(swum: Experiment, first: int, count: int, measured: bool) -> Experiment:
    """The experiment with `count` commands lost in its first trial, and the encoder's samples of then if it does not measure."""
    given, encoder, grid = swum.commands.copy(), swum.encoder.copy(), DT * np.arange(swum.length)
    if not measured:
        encoder[first : first + count + 1, 0] = np.nan
    kept = np.delete(np.arange(swum.length), np.arange(first, first + count))
    given[:, 0], encoder[:, 0] = commands_on_grid(grid[kept], given[kept, 0], grid, encoder[:, 0])
    return replace(swum, commands=given, encoder=encoder)


@pytest.mark.parametrize("measured", [True, False])
@pytest.mark.parametrize("count", [1, 5])
@pytest.mark.parametrize("first", [200, 238])
def test_lost_commands_cost_next_to_nothing(
    swum: Experiment, first: int, count: int, measured: bool
) -> None:
    """At the truth; held they cost 5 lost messages thousands of nats."""
    hypothesis = nominal_hypothesis(Robot(), ())
    lost = losing(swum, first, count, measured)
    seen = np.isfinite(lost.encoder)  # what takes the command's place is no measurement
    whole = replace(swum, encoder=np.where(seen, swum.encoder, np.nan))
    full, found = (
        evaluate(hypothesis, np.zeros(0), e, Noise()).log_posterior for e in (whole, lost)
    )
    assert abs(full - found) < 8.0
    held = whole.commands.copy()
    held[first : first + count, 0] = held[first - 1, 0]
    cost = (
        full
        - evaluate(hypothesis, np.zeros(0), replace(whole, commands=held), Noise()).log_posterior
    )
    assert count == 1 or cost > 200.0


def test_without_the_encoder_a_curve_follows_the_strokes() -> None:
    for count, off in ((1, 0.05), (3, 0.1), (9, 1.0)):
        kept = without(PEAK - count // 2, count)
        given, encoder = commands_on_grid(GRID[kept], TOLD[kept], GRID, SILENT)
        assert np.abs(given[:, 0] - TOLD[:, 0]).max() < off
        assert np.abs(given[:, 1] - TOLD[:, 1]).max() < 0.004
        assert np.isnan(encoder).all()
        np.testing.assert_array_equal(given[kept], TOLD[kept])


def test_the_encoder_counts_where_it_measured_and_a_rudder_that_jumped_gets_a_line() -> None:
    kept, encoder = without(100, 6), np.full(len(GRID), 7.0)
    encoder[103] = np.nan  # tells of the command before it
    given = TOLD.copy()
    given[103:, 1] = 0.9
    found, left = commands_on_grid(GRID[kept], given[kept], GRID, encoder)
    assert found[[100, 101, 103, 104, 105], 0].tolist() == [7.0] * 5
    assert found[102, 0] == pytest.approx(TOLD[102, 0], abs=0.5)
    np.testing.assert_allclose(np.diff(found[99:107, 1]), (0.9 - given[99, 1]) / 7, atol=1e-12)
    assert np.isnan(left[101:107]).all()
    assert (left[[100, 107]] == 7.0).all()


def test_a_hole_at_either_end_has_fewer_commands_to_run_through() -> None:
    for first in (1, len(GRID) - 4):
        kept = without(first, 3)
        given, _ = commands_on_grid(GRID[kept], TOLD[kept], GRID, SILENT)
        assert np.abs(given[:, 0] - TOLD[:, 0]).max() < 2.0


@pytest.mark.parametrize("late", [0.004, 0.006, 0.009, 0.0099, 0.01])
@pytest.mark.parametrize("which", [PEAK - 3, PEAK - 1])
def test_a_late_command_beside_a_hole_throws_the_rotor_not_far_off(late: float, which: int) -> None:
    """A line through the hole cuts the top of a stroke by 2 rad/s; a command 10 ms late has the stamp of the next one."""
    kept = without(PEAK - 1, 3)
    t = GRID[kept]
    t[which] += late
    given, _ = commands_on_grid(t, TOLD[kept], GRID, SILENT)
    hole = slice(PEAK - 1, PEAK + 2)
    assert np.abs(given[hole, 0] - TOLD[hole, 0]).max() < 2.5


def test_a_hole_that_is_too_long_is_said() -> None:
    commands_on_grid(GRID[(kept := without(200, 9))], TOLD[kept], GRID, SILENT)
    kept = without(200, 10)
    with pytest.raises(
        LostCommandsError,
        match=r"from 1\.99 to 2\.10 s, where one comes every 10 ms; .* cut .* or record",
    ):
        commands_on_grid(GRID[kept], TOLD[kept], GRID, SILENT)


def random_stamps(spread: float) -> np.ndarray:
    return np.cumsum(np.maximum(DT + spread * np.random.default_rng(0).standard_normal(500), 1e-3))


@pytest.mark.parametrize(
    "t",
    [
        np.cumsum(np.random.default_rng(1).exponential(0.03, 500)),  # on events
        random_stamps(0.004),  # late and early
        np.concatenate([GRID, 4.0 + 0.5 * np.arange(200)]),  # when something changes
        np.sort(
            np.concatenate([GRID[:200], GRID[200:] + 0.007])
        ),  # one that came late, and all after it
        GRID[:5],
    ],
)
def test_commands_that_do_not_come_on_a_beat_are_held(t: np.ndarray) -> None:
    assert holes(t) == []


def late_commands() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(stamps, commands, encoder): each command reaches the rotor up to 30 ms after its stamp."""
    rng = np.random.default_rng(2)
    t = np.unique(np.round(GRID + 0.03 * rng.random(len(GRID)), 2))
    arrived = np.searchsorted(t + 0.03 * rng.random(len(t)), GRID, side="right") - 1
    given = TOLD[np.searchsorted(GRID, t).clip(0, len(GRID) - 1)]
    followed = given[np.maximum(arrived, 0), 0]
    return t, given, np.append(0.0, followed[:-1]) + 0.2 * rng.standard_normal(len(GRID))


def test_the_encoder_drives_a_rotor_that_irregular_commands_do_not_explain() -> None:
    t, given, encoder = late_commands()
    commands, left = commands_on_grid(t, given, GRID, encoder)
    np.testing.assert_allclose(commands[:-1, 0], encoder[1:])
    assert np.isnan(left).all()
    _, kept = commands_on_grid(t, given, GRID, SILENT)
    np.testing.assert_array_equal(kept, SILENT)


@pytest.mark.parametrize("factor", [0.0, -1.0, 60.0 / (2.0 * np.pi)])  # dead, turned, in 1/min
def test_an_encoder_that_shows_another_motion_drives_nothing(factor: float) -> None:
    t, given, encoder = late_commands()
    _, left = commands_on_grid(t, given, GRID, factor * encoder)
    np.testing.assert_array_equal(left, factor * encoder)


def test_irregular_commands_that_the_rotor_follows_are_held() -> None:
    t, given, _ = late_commands()
    held = given[np.clip(np.searchsorted(t, GRID + 0.5 * DT, side="right") - 1, 0, None), 0]
    encoder = np.append(0.0, held[:-1])
    commands, left = commands_on_grid(t, given, GRID, encoder)
    np.testing.assert_array_equal(commands[:, 0], held)
    np.testing.assert_array_equal(left, encoder)


def test_a_long_hole_in_which_everything_stands_is_none() -> None:
    t, still = GRID[without(200, 30)], np.zeros((len(GRID) - 30, 2))
    noise = 0.2 * np.random.default_rng(3).standard_normal(len(GRID))
    commands, _ = commands_on_grid(t, still, GRID, noise)
    assert not commands.any()
    for unlike in (SILENT, TOLD[:, 0]):  # nobody knows, or it swam
        with pytest.raises(LostCommandsError):
            commands_on_grid(t, still, GRID, unlike)


def test_the_beat_may_be_another_than_the_grids_and_many_may_be_lost() -> None:
    assert holes(np.delete(0.02 * np.arange(200), [50, 51])) == [49]
    lost = np.arange(20, 380, 10)
    t = np.delete(GRID + 0.0003 * np.random.default_rng(0).standard_normal(len(GRID)), lost)
    assert len(holes(t)) == len(lost)
    given = np.delete(TOLD, lost, axis=0)
    found, _ = commands_on_grid(t, given, t[0] + DT * np.arange(len(GRID)), SILENT)
    np.testing.assert_allclose(found[lost, 0], TOLD[lost, 0], atol=2.0)


@pytest.fixture(scope="module")
def seen_by_both() -> Experiment:
    """A gyro that is read at 20 Hz, and an orientation of the same moments that has integrated at 100 Hz."""
    made = kinematic_swims(World(), 5, 2)
    headings = []
    gyro = np.full_like(made.gyro, np.nan)
    for m, steps in enumerate(made.steps):
        rate = made.gyro[:steps, m]
        turned = DT * (np.cumsum(rate) - 0.5 * rate)
        read = np.arange(0, steps, 5)
        gyro[read, m] = rate[read]
        headings.append(Headings(DT * read, 0.7 + turned[read]))
    return replace(made, gyro=gyro, headings=tuple(headings))


def test_equal_turns_leave_nothing(seen_by_both) -> None:
    rest, size = orientation_windows(seen_by_both, 0).T
    assert len(rest) == int((16.0 - WINDOW) / WINDOW)
    assert abs(rest @ size / (size @ size)) < 0.01


@pytest.mark.parametrize("factor", [0.95, 1.05])
def test_a_gyro_that_reads_too_much_shows_in_every_window(seen_by_both, factor) -> None:
    rest, size = orientation_windows(with_gyro_scale(seen_by_both, factor), 1).T
    assert 1.0 / (1.0 + rest / size) == pytest.approx(factor, abs=0.02)


def test_nobody_knows_how_it_turned_across_a_hole(seen_by_both) -> None:
    """A gyro that says nothing for a second in which the fish turned: the same scale, and nothing of that second."""
    torn = seen_by_both.gyro.copy()
    torn[600:700, 0] = np.nan
    rest, size = orientation_windows(replace(seen_by_both, gyro=torn), 0).T
    assert abs(rest @ size / (size @ size)) < 0.01


def test_without_an_orientation_there_is_nothing_to_compare(seen_by_both) -> None:
    assert orientation_windows(replace(seen_by_both, headings=()), 0).shape == (0, 2)


@pytest.fixture(scope="module")
def swum_with_marker() -> Experiment:
    random = np.random.default_rng(2)
    commands = np.stack([program(kind, 4.0, random) for kind in ("sines", "steps")], axis=1)
    return record(Robot(), commands, Noise(), random)[0]


def test_a_point_ahead_of_one_that_looks_along_y_lies_along_y() -> None:
    pose = np.array([[0.4, -0.2, np.pi / 2], [0.0, 0.0, np.pi]])
    assert forward(pose, 0.03) == pytest.approx(
        np.array([[0.4, -0.17, np.pi / 2], [-0.03, 0.0, np.pi]])
    )


def test_places_add_up_and_none_leaves_no_entry() -> None:
    robot = with_marker(with_marker(Robot(), -0.02), -0.01)
    assert ahead_of(robot) == pytest.approx(-0.03)
    assert with_marker(robot, 0.03).sensors == {}


def test_a_diagnosis_starts_from_poses_of_the_centre_of_mass(swum_with_marker: Experiment) -> None:
    """The IMU's clock and the point are the robot's own, and no effects that the filter could fit."""
    robot = with_marker(Robot(), -0.03).with_effect("imu_latency", delay=0.02)
    assert known_effects(robot) == ()
    task = make_task(at_centre_of_mass(swum_with_marker, 0.03), robot, names=["current"])
    assert ahead_of(task.robot) == 0.0
    for seen, true in zip(task.experiment.frames, swum_with_marker.frames, strict=True):
        assert seen.pose == pytest.approx(true.pose, abs=1e-12)


SAMPLED = DT * np.arange(2000)


def strokes(t: np.ndarray) -> np.ndarray:
    """What an IMU feels of a fish: 2 Hz, with parts at its multiples."""
    return np.sin(4.0 * np.pi * t) + 0.3 * np.cos(12.0 * np.pi * t) + 0.1 * np.sin(30.0 * np.pi * t)


@pytest.mark.parametrize(
    ("phase", "rate"), [(0.004, 100.0), (0.005, 100.0), (0.0, 99.3), (0.001, 400.0), (0.002, 50.0)]
)
def test_a_clock_of_its_own_moves_no_signal(phase: float, rate: float) -> None:
    t = np.arange(phase, SAMPLED[-1], 1.0 / rate)
    found = on_grid(t, strokes(t), SAMPLED, DT)
    seen = np.isfinite(found)
    assert seen.sum() == pytest.approx(
        min(len(t), len(SAMPLED)), abs=15
    )  # no more values than there were samples
    assert np.abs(found - strokes(SAMPLED))[seen].max() < (0.03 if rate < 100.0 else 0.003)


def test_samples_on_the_grid_are_taken_as_they_are_and_missing_ones_stay_missing() -> None:
    kept = np.random.default_rng(0).random(len(SAMPLED)) > 0.2
    noise = np.random.default_rng(1).standard_normal((len(SAMPLED), 2))
    found = on_grid(SAMPLED[kept] + 1e-9, noise[kept], SAMPLED, DT)
    np.testing.assert_allclose(found[kept], noise[kept], atol=1e-4)
    assert np.isnan(found[~kept]).all()


def test_noise_stays_white_enough() -> None:
    """Half-way between samples, where it is worst: a straight line has 0.5 of the variance and neighbours that go together."""
    noise = np.random.default_rng(2).standard_normal(len(SAMPLED))
    found = on_grid(SAMPLED + 0.5 * DT, noise, SAMPLED, DT)[1:-1]
    assert found.var() > 0.78
    assert np.mean(found[1:] * found[:-1]) / found.var() < 0.25


def test_nothing_is_made_up_in_a_gap_or_beyond_the_ends() -> None:
    t = np.concatenate([np.arange(1.003, 4.0, DT), np.arange(6.003, 9.0, DT)])
    seen = SAMPLED[np.isfinite(on_grid(t, strokes(t), SAMPLED, DT))]
    assert seen.min() == pytest.approx(1.01)
    assert seen.max() == pytest.approx(8.99)
    assert not ((seen > 4.0) & (seen < 6.0)).any()
    assert np.isnan(on_grid(np.zeros(0), np.zeros((0, 2)), SAMPLED, DT)).all()


def test_stamps_close_together_or_twice_throw_nothing_off() -> None:
    t = np.sort(np.concatenate([SAMPLED + 0.003, SAMPLED[::50] + 0.0031, SAMPLED[7::50] + 0.003]))
    noisy = strokes(t) + 0.05 * np.random.default_rng(3).standard_normal(len(t))
    found = on_grid(t, noisy, SAMPLED, DT)
    assert np.nanmax(np.abs(found - strokes(SAMPLED))) < 0.3
    assert np.isnan(
        on_grid(np.array([0.502]), np.array([7.0]), SAMPLED, DT)
    ).all()  # one sample has no slope


def test_faster_samples_than_the_grids_are_thinned_and_others_all_kept() -> None:
    random = np.random.default_rng(4)
    for rate in (11.0, 30.0, 60.0, 100.0, 100.0 * (1.0 + 5e-5)):
        t = 0.005 + np.arange(500) / rate
        assert len(apart(t, DT)) >= 499
        assert len(apart(t + 1e-9 * random.standard_normal(500), DT)) >= 499
    for rate in (120.0, 240.0, 1000.0):
        t = np.sort(np.arange(500) / rate + 1e-3 * random.standard_normal(500))
        kept = t[apart(t, DT)]
        assert np.diff(kept).min() > 0.95 * DT - 1e-12
        slots = np.maximum.accumulate(kept - DT * np.arange(len(kept))) + DT * np.arange(len(kept))
        assert (
            slots - kept
        ).max() <= 0.05 * DT + 1e-12  # a grid point each, wherever the grid begins
    assert len(apart(np.zeros(0), DT)) == 0


@pytest.fixture(scope="module")
def pushed_off() -> Experiment:
    """Full strokes from the first sample on, with the rudder turned."""
    strokes = FULL_SPEED * np.sin(2.0 * np.pi * STROKE * DT * np.arange(300) + 0.3)
    commands = np.stack([np.column_stack([strokes, np.full(300, 0.6)])] * 5, axis=1)
    return record(Robot(), commands, Noise(), np.random.default_rng(4))[0]


@pytest.fixture(scope="module")
def glided() -> Experiment:
    """A fish that swam, and since half a second has not been told anything."""
    random = np.random.default_rng(1)
    before = np.concatenate([program("straight", 4.0, random) * [1.5, 1.0], np.zeros((150, 2))])
    commands = np.stack(
        [np.concatenate([before, program(kind, 3.0, random)]) for kind in KINDS], axis=1
    )
    made, first = record(Robot(), commands, Noise(), random)[0], len(before) - 50
    arrays = {key: getattr(made, key)[first:] for key in ("commands", "gyro", "accel", "encoder")}
    seen = [f.t >= DT * first for f in made.frames]
    frames = tuple(
        Frames(f.t[s] - DT * first, f.pose[s]) for f, s in zip(made.frames, seen, strict=True)
    )
    return replace(made, steps=made.steps - first, frames=frames, **arrays)


def found(e: Experiment) -> list[bool]:
    return [
        starts_at_rest(e.gyro[:, m], e.accel[:, m], e.encoder[:, m], f.t, f.pose)
        for m, f in enumerate(e.frames)
    ]


@pytest.mark.parametrize("delay", [0.0, 0.05, 0.1, 0.2])
def test_strokes_from_rest_are_no_glide_though_the_image_is_old(
    pushed_off: Experiment, delay: float
) -> None:
    """Images show rest until the delay is over; the accelerometer feels the strokes at once."""
    frames = []
    for f in pushed_off.frames:
        rest = np.arange(0.001, delay, 1 / 30)
        still = f.pose[:1].repeat(len(rest), axis=0)
        frames.append(Frames(np.concatenate([rest, f.t + delay]), np.concatenate([still, f.pose])))
    assert all(found(replace(pushed_off, frames=tuple(frames))))


def test_strokes_push_a_fish_at_rest_as_far_as_a_glide(pushed_off: Experiment) -> None:
    """Only the accelerometer tells them apart."""
    without = replace(pushed_off, accel=np.full_like(pushed_off.accel, np.nan))
    assert not all(found(without))


def test_a_glide_is_no_rest_though_nothing_turns(glided: Experiment) -> None:
    assert np.abs(glided.gyro[0]).max() < 0.1
    assert np.abs(glided.encoder[0]).max() < 1.0
    assert not any(found(glided))
    blind = np.full_like(glided.accel, np.nan)
    assert not any(found(replace(glided, accel=blind)))


def test_a_rotor_or_a_fish_that_turns_is_no_rest_and_who_does_not_see_believes_the_others(
    pushed_off: Experiment,
) -> None:
    encoder, gyro = pushed_off.encoder.copy(), pushed_off.gyro.copy()
    encoder[0, 0], encoder[0, 1], gyro[0, 2], gyro[0, 3] = 20.0, np.nan, 0.3, np.nan
    assert found(replace(pushed_off, encoder=encoder, gyro=gyro)) == [
        False,
        True,
        False,
        False,
        True,
    ]
    late = tuple(Frames(f.t + 1.0, f.pose) for f in pushed_off.frames)
    assert all(found(replace(pushed_off, frames=late)))


def commands(end: int = 300) -> tuple[np.ndarray, np.ndarray]:
    """Rotor that stands and rudder that is 0 from a grid point on, as the log of a controller that has ended says."""
    k = np.arange(500)
    rotor = np.where(k < end, 60.0 * np.sin(0.1 * k), 40.0)
    return rotor, np.where(k < end, -0.3, 0.0)


def test_a_servo_keeps_its_last_command_when_the_controller_has_ended() -> None:
    rotor, rudder = commands()
    assert held_rudder(rotor, rudder) == pytest.approx(np.full(500, -0.3))


def test_a_servo_keeps_it_also_where_the_encoder_drives_the_rotor() -> None:
    t, given, encoder = late_commands()
    given = np.where(t[:, None] < 3.3, np.column_stack([given[:, 0], 0.0 * t - 0.3]), [40.0, 0.0])
    ended = np.flatnonzero(GRID >= 3.3)
    encoder[ended] = 40.0 + 0.2 * np.cos(GRID[ended])
    found, left = commands_on_grid(t, given, GRID, encoder)
    assert np.isnan(left).all()
    np.testing.assert_array_equal(found[:, 1], -0.3)


def test_a_rudder_that_is_told_to_centre_is_centred() -> None:
    rotor, rudder = commands()
    swimming = 60.0 * np.sin(0.1 * np.arange(500))
    assert (held_rudder(swimming, rudder) == rudder).all()
    assert (held_rudder(np.where(rotor == 40.0, 0.0, rotor), rudder) == rudder).all()
    moved = rudder.copy()
    moved[450] = 0.1
    assert (held_rudder(rotor, moved) == moved).all()
    early = np.where(np.arange(500) < 200, -0.3, 0.0)
    assert (held_rudder(rotor, early) == early).all()


def test_imu_readings_go_back_to_when_they_were_taken() -> None:
    random = np.random.default_rng(0)
    told = program("sines", 4.0, random)[:, None]
    made, true = record(Robot(), told, Noise(gyro=1e-9), random)
    late = replace(
        made,
        gyro=np.concatenate([np.full((3, 1), np.nan), made.gyro[:-3]]),
        headings=(Headings(DT * np.arange(400) + 0.03, true.state[:, 0, 2]),),
    )
    back = imu_moved_back(late, 0.03)
    assert back.gyro[:-3] == pytest.approx(made.gyro[:-3])
    assert np.isnan(back.gyro[-3:]).all()
    assert back.headings[0].t == pytest.approx(DT * np.arange(400))


def test_what_a_trial_lacks_is_said_of_that_trial() -> None:
    random = np.random.default_rng(0)
    told = np.stack([program(kind, 6.0, random) for kind in ("straight", "sines")], axis=1)
    made, _ = record(Robot(), told, Noise(), random)
    gyro = made.gyro.copy()
    gyro[:130, 1] = np.nan
    texts = incomplete(replace(made, gyro=gyro))
    assert any(t.startswith("synthetic_01: no IMU from 0.0 to 1.3 s") for t in texts)
    assert any(t.startswith("synthetic_00: turns by") for t in texts)
    assert not any(t.startswith("synthetic_00: no") for t in texts)


def test_grid_points_far_from_known_ones_lie_in_holes():
    known = np.array([1, 0, 0, 1, 0, 1, 1, 0, 0, 0, 1, 0, 0], dtype=bool)
    assert np.flatnonzero(in_holes(known, 3)).tolist() == [7, 8, 9]
    assert np.flatnonzero(in_holes(known, 2)).tolist() == [1, 2, 7, 8, 9, 11, 12]
    assert in_holes(np.zeros(4, dtype=bool), 3).all()
