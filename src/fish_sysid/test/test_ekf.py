# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The extended Kalman filter and its noise."""

from __future__ import annotations

import tracemalloc
import warnings
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import norm

from fish_report.parallel import on_all_cores
from fish_sim.compiled import lanes
from fish_sim.effects import EFFECTS
from fish_sim.model import DT
from fish_sim.robot import Robot
from fish_sysid.dataset.experiment import Experiment, Frames, Headings, shorten
from fish_sysid.dataset.synthetic import program, record
from fish_sysid.estimation import ekf_compiled
from fish_sysid.estimation.ekf import filter_stepper, run_filter
from fish_sysid.estimation.ekf_compiled import compiled_passes
from fish_sysid.estimation.ekf_numpy import Filter
from fish_sysid.estimation.ekf_types import Noise, Problem, SensorModel, encoder_terms, place_frames
from fish_sysid.estimation.map_fit import (
    NOISE_MOVES,
    Fit,
    Reach,
    estimate_noise,
    evaluate,
    likelihoods,
    octaves,
)
from fish_sysid.estimation.noise_estimation import (
    FEWEST,
    SMALLEST,
    commanded_residual,
    encoder_noise,
    usual_noise,
    white_noise,
)
from fish_sysid.estimation.parametrization import NOMINAL_FREE, nominal_hypothesis
from fish_sysid.estimation.refit import alternate
from fish_sysid.estimation.smoother import smooth, smoothed

SENSORS = (
    "camera_latency",
    "camera_heading_offset",
    "camera_scale",
    "gyro_scale",
    "imu_misalignment",
)


def experiment(robot: Robot, duration: float, kinds: tuple[str, ...], seed: int = 0):
    random = np.random.default_rng(seed)
    commands = np.stack([program(kind, duration, random) for kind in kinds], axis=1)
    return record(robot, commands, Noise(), random)


def with_sensors(robot: Robot):
    hypothesis = nominal_hypothesis(robot)
    for name in SENSORS:
        hypothesis = hypothesis.with_effect(name, 0.1)
    return hypothesis


@pytest.mark.usefixtures("shipped_flags")
@pytest.mark.parametrize("width", [2, 4, 8])
@pytest.mark.parametrize("stiffness", [None, 1.5], ids=["nominal", "a tail that needs more steps"])
def test_compiled_and_numpy_passes_agree(stiffness, width, monkeypatch):
    if width > lanes():
        pytest.skip(f"vectors of this processor hold {lanes()} numbers")
    monkeypatch.setattr(ekf_compiled, "lanes", lambda: width)
    monkeypatch.setattr(ekf_compiled, "filter_library", ekf_compiled.filter_library.__wrapped__)
    data, _ = experiment(Robot(), 1.5, ("sines", "steps"))
    robot = Robot() if stiffness is None else Robot().with_parameters(tail_stiffness=stiffness)
    coordinates = with_sensors(robot).parametrization
    problem = Problem(data, coordinates.stepper, *coordinates.filter_inputs(coordinates.origin()))
    slow = Filter(problem, Noise()).run(keep=True)
    passes = compiled_passes(problem, [Noise(gyro=0.1), Noise()], keep=True)
    if passes is None:
        pytest.skip("no C compiler here")
    fast = passes[1]
    for key in ("log_likelihood", "gradient", "normal", "whitened"):
        a, b = getattr(slow, key), getattr(fast, key)
        np.testing.assert_allclose(a, b, rtol=1e-8, atol=1e-8 * np.nanmax(np.abs(a)))
    np.testing.assert_allclose(
        slow.history.filtered_P, fast.history.filtered_P, rtol=1e-6, atol=1e-12
    )


@pytest.mark.parametrize(
    "edit",
    [
        "s/(3.0 - 2.0 \\* c)/(3.0 - 2.0001 * c)/",  # where in the step its slopes are taken
        "s/d->gradient += v_constant(r\\[a\\])/d->gradient += v_constant(1.000001 * r[a])/",
    ],
)
def test_a_filter_that_the_compiler_gets_wrong_is_not_used(edit, wrong_compiler, caplog):
    wrong_compiler(edit)
    assert ekf_compiled.filter_library.__wrapped__((1, (EFFECTS["disturbance"],)), "cfmr7") is None
    (record,) = caplog.records
    assert "the slower interpreted form is used" in record.message


def test_the_memory_of_all_trials_is_never_held_at_once():
    """A delay's memory times trials times free parameters would be gigabytes of a day in the pool."""
    data, _ = experiment(Robot(), 2.0, ("sines", "steps") * 4)
    coordinates = nominal_hypothesis(Robot()).with_effect("rudder_delay").parametrization
    problem = Problem(data, coordinates.stepper, *coordinates.filter_inputs(coordinates.origin()))
    if compiled_passes(problem, [Noise()], keep=False) is None:
        pytest.skip("no C compiler here")
    tracemalloc.start()
    compiled_passes(problem, [Noise()], keep=False)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    rows = data.length * len(data.names) * len(problem.dp)
    both = (
        16.0 * rows * len(coordinates.stepper.layout.memory)
    )  # bytes of all memories and their derivatives
    assert peak < 0.5 * both


def test_innovations_are_white_with_unit_variance_at_the_truth():
    data, _ = experiment(Robot(), 10.0, ("sines", "steps", "random"))
    coordinates = nominal_hypothesis(Robot(), ()).parametrization
    result = run_filter(data, coordinates.stepper, *coordinates.filter_inputs(np.zeros(0)), Noise())
    w = result.whitened[:, :, :3]
    np.testing.assert_allclose(
        np.nanmean(w**2, axis=(0, 1)), 1.0, atol=0.08
    )  # 3000 samples: sd 0.026
    lagged = np.nanmean(w[1:] * w[:-1], axis=(0, 1))
    np.testing.assert_allclose(lagged, 0.0, atol=0.07)


def test_the_transition_is_the_derivative_of_the_simulators_step():
    """Linearised in the middle of a step against the integrator's own derivative; both motions swim."""
    data, _ = experiment(Robot(), 3.0, ("sines", "steps"))
    coordinates = nominal_hypothesis(Robot(), ()).parametrization
    stepper, (p, dp, sensors) = coordinates.stepper, coordinates.filter_inputs(np.zeros(0))
    history = run_filter(data, stepper, p, dp, sensors, Noise(), keep=True).history
    nx = len(stepper.layout.motion)
    for k in (100, 150, 250):
        for m in range(2):
            state = np.concatenate([history.filtered[k, m, :nx], history.memory[k, m]])
            wrench = dict(
                zip(("surge", "sway", "yaw"), history.filtered[k, m, nx : nx + 3], strict=True)
            )
            here = coordinates.hypothesis.robot.with_effect("disturbance", **wrench)
            exact = stepper.rollout_jvp(
                state,
                data.commands[k, m][None],
                stepper.parameters(here),
                np.eye(len(state))[:nx],
                np.zeros((1, 2)),
                np.zeros(len(p)),
            )[1][1]
            scale = np.abs(exact[:, :nx]).max(axis=0)
            np.testing.assert_allclose(
                history.transition[k, m, :nx, :nx].T / scale, exact[:, :nx] / scale, atol=5e-3
            )


def test_gradient_is_zero_in_the_mean_and_as_large_as_the_normal_matrix_says_at_the_truth():
    """The score's variance is the information; of a drag that is 5 % off the score is far from zero."""
    data, _ = experiment(Robot(), 3.0, ("sines", "steps", "random", "sines", "steps", "random"))
    free = ("head_drag_surge", "head_drag_sway", "head_drag_yaw", "head_inertia", "tail_stiffness")

    def score(robot: Robot):
        result = evaluate(
            nominal_hypothesis(robot, free), np.zeros(len(free)), data, Noise()
        ).result
        return result.gradient.sum(0) / np.sqrt(np.diagonal(result.normal.sum(0)))

    right = score(Robot())
    assert np.abs(right).max() < 3.5
    assert 0.3 < np.sqrt(np.mean(right**2)) < 1.8  # of five that are not independent
    off = score(Robot().with_parameters(head_drag_yaw=1.05 * Robot().parameters["head_drag_yaw"]))
    assert abs(off[free.index("head_drag_yaw")]) > 5.0


def test_a_missing_sensor_costs_nothing_but_its_samples():
    data, _ = experiment(Robot(), 6.0, ("sines",))
    blind = replace(
        data, accel=np.full_like(data.accel, np.nan), gyro=np.full_like(data.gyro, np.nan)
    )
    fit = evaluate(nominal_hypothesis(Robot()), np.zeros(len(NOMINAL_FREE)), blind, Noise())
    assert np.isfinite(fit.log_posterior)
    seeing = evaluate(fit.hypothesis, fit.theta, data, Noise())
    assert fit.result.samples[0] == seeing.result.samples[0] - 3 * data.length


def test_smoother_finds_a_known_wrench():
    """A constant push that the model does not know appears in the smoothed wrench."""
    push = 0.05
    robot = Robot().with_effect("disturbance", surge=push)
    random = np.random.default_rng(1)
    data, _ = record(Robot(), np.stack([program("sines", 6.0, random)], axis=1), Noise(), random)
    pushed, _ = record_pushed(robot)
    noise = replace(Noise(), wrench=(0.05, 0.02, 5e-4), wrench_time=2.0)
    quiet = smoothed_surge(data, noise)
    assert abs(quiet) < 0.01
    assert smoothed_surge(pushed, noise) == pytest.approx(push, abs=0.012)


def record_pushed(robot: Robot):
    """The push as part of the water's wrench: added to the recorded motion through a current-free constant force."""
    import fish_sysid.dataset.synthetic as synthetic

    random = np.random.default_rng(1)
    commands = np.stack([program("sines", 6.0, random)], axis=1)
    original = synthetic._swim

    def swim(stepper, p, commands, noise, random):
        at = stepper.layout.parameters.index("disturbance.surge")
        states = np.empty((len(commands), commands.shape[1], len(stepper.layout.state)))
        states[0] = stepper.rest()
        p = p.copy()
        p[at] = robot.effects["disturbance"]["surge"]
        for k in range(len(commands) - 1):
            states[k + 1] = stepper.step(states[k], commands[k], p)
        wrench = np.zeros((*commands.shape[:2], 3))
        wrench[..., 0] = p[at]
        return states, wrench

    synthetic._swim = swim
    try:
        return record(Robot(), commands, Noise(), random)
    finally:
        synthetic._swim = original


def test_near_a_trials_end_the_fixed_lag_smoother_is_that_of_the_whole_trial():
    data, _ = experiment(Robot(), 2.0, ("sines",))
    starts = np.array([[0, data.length - back] for back in (60, 30, 5, 1)])
    coordinates = nominal_hypothesis(Robot(), ()).parametrization
    inputs = coordinates.filter_inputs(np.zeros(0))
    history = run_filter(data, coordinates.stepper, *inputs, Noise(), keep=True).history
    whole, deviation = smooth(history)
    off = smoothed(data, Robot(), Noise(), starts, 0.5) - whole[starts[:, 1], 0]
    assert (
        np.abs(off / deviation[starts[:, 1], 0])[1:].max() < 1e-6
    )  # the end is nearer than the lag
    assert np.abs(off / deviation[starts[:, 1], 0])[0].max() < 0.5


def smoothed_surge(data, noise: Noise) -> float:
    fit = evaluate(nominal_hypothesis(Robot(), ()), np.zeros(0), data, noise, keep=True)
    xi, _ = smooth(fit.result.history)
    nx = xi.shape[2] - 6
    return float(np.mean(xi[200:-100, 0, nx]))


def test_a_smoothed_state_is_as_sure_as_it_says_and_surer_than_the_filtered_one() -> None:
    data, truth = experiment(Robot(), 6.0, ("sines", "steps", "random"))
    fit = evaluate(nominal_hypothesis(Robot(), ()), np.zeros(0), data, Noise(), keep=True)
    xi, deviation = smooth(fit.result.history)
    filtered = np.sqrt(np.diagonal(fit.result.history.filtered_P, axis1=2, axis2=3))
    pose, inner = slice(0, 3), slice(100, 500)
    z = (xi[inner, :, pose] - truth.state[inner, :, pose]) / deviation[inner, :, pose]
    size = np.sqrt(
        np.mean(z**2, axis=(0, 1))
    )  # of few independent samples: an error of a pose lasts
    assert np.all((0.6 < size) & (size < 1.7))
    assert np.all(deviation[inner, :, pose] < 0.9 * filtered[inner, :, pose])
    error = np.mean(np.square(xi[inner, :, pose] - truth.state[inner, :, pose]), axis=(0, 1))
    causal = fit.result.history.filtered[inner, :, pose] - truth.state[inner, :, pose]
    assert np.all(error < np.mean(causal**2, axis=(0, 1)))


def test_a_short_trial_is_smoothed_beside_a_long_one_as_alone():
    data, _ = experiment(Robot(), 1.5, ("sines", "steps"))
    uneven = replace(data, steps=np.array([150, 90]))
    coordinates = nominal_hypothesis(Robot(), ()).parametrization
    inputs = coordinates.filter_inputs(np.zeros(0))

    def smoothed(some):
        return smooth(run_filter(some, coordinates.stepper, *inputs, Noise(), keep=True).history)[0]

    np.testing.assert_allclose(
        smoothed(uneven)[:90, 1], smoothed(uneven.select([1]))[:, 0], atol=1e-9
    )


@pytest.mark.parametrize("compiled", [True, False])
def test_a_filter_that_diverges_says_from_where(compiled):
    data, _ = experiment(Robot(), 1.0, ("sines", "steps"))
    commands = data.commands.copy()
    commands[40:, 1, 0] = 1e9  # rad/s
    coordinates = nominal_hypothesis(Robot(), ()).parametrization
    inputs = coordinates.filter_inputs(np.zeros(0))
    problem = Problem(replace(data, commands=commands), coordinates.stepper, *inputs)
    if compiled:
        (result,) = compiled_passes(problem, [Noise()], keep=True) or [None]
        if result is None:
            pytest.skip("no compiler")
    else:
        result = Filter(problem, Noise()).run(keep=True)
    lost = ~np.isfinite(result.history.filtered).all(axis=2)
    assert not lost[:, 0].any()
    assert not lost[:41, 1].any()
    assert lost[50:, 1].all()
    assert np.isfinite(result.log_likelihood[0])
    assert not np.isfinite(result.log_likelihood[1])


@pytest.mark.parametrize("rate", [60.0, 100.0, 120.0])
def test_which_images_are_used_does_not_depend_on_the_latency(rate):
    """Two at one grid point would overwrite each other, now these and now those: the likelihood would be jagged."""
    random = np.random.default_rng(3)
    commands = np.stack([program(kind, 4.0, random) for kind in ("sines", "steps")], axis=1)
    data, _ = record(Robot(), commands, Noise(), random, rate)
    for latency in np.arange(0.0, 0.011, 0.0004):
        offset, pose = place_frames(data, SensorModel(camera_latency=latency))
        for m, frames in enumerate(data.frames):
            taken = frames.t - latency
            inner = (taken > -0.004) & (taken < 3.98)
            assert np.isin(frames.pose[inner, 0], pose[:, m, 0]).all()
            used = np.isfinite(offset[:, m])
            found = np.interp(
                taken[inner], (0.01 * np.arange(400) + offset[:, m])[used], pose[used, m, 0]
            )
            np.testing.assert_allclose(found, frames.pose[inner, 0], atol=1e-9)
            assert np.abs(offset[used, m]).max() <= 0.0055 + 1e-12


def test_a_camera_a_little_faster_than_the_grid_loses_no_image_to_another():
    data, _ = experiment(Robot(), 1.0, ("sines",))
    t = 0.0002 + 0.009996 * np.arange(99)
    quick = replace(data, frames=(Frames(t, np.zeros((len(t), 3))),))
    for latency in np.arange(0.0, 0.01, 0.0001):
        offset, _ = place_frames(quick, SensorModel(camera_latency=latency))
        assert np.isfinite(offset).sum() == np.sum(t - latency >= -0.005)


@pytest.mark.parametrize("wait", [0.5, 3.0])
def test_a_camera_that_starts_late_is_believed(wait):
    """Until then the fish has swum and turned, which nobody saw."""
    random = np.random.default_rng(1)
    commands = np.stack([program(kind, 6.0, random) for kind in ("turn", "steps")], axis=1)
    commands[..., 0] *= 1.5
    data, _ = record(Robot(), commands, Noise(), random)
    late = replace(
        data, frames=tuple(Frames(f.t[f.t > wait], f.pose[f.t > wait]) for f in data.frames)
    )
    w = evaluate(nominal_hypothesis(Robot(), ()), np.zeros(0), late, Noise()).result.whitened
    for m, frames in enumerate(late.frames):
        assert np.hypot(*frames.pose[0, :2]) > (0.1 if wait > 1.0 else 0.0)
        assert np.isfinite(w[:, m, 3]).sum() == len(frames.t)
        np.testing.assert_allclose(np.sqrt(np.nanmean(w[:, m] ** 2, axis=0)), 1.0, atol=0.2)


def test_a_fast_tail_gets_the_steps_it_needs():
    robot = Robot().with_parameters(tail_stiffness=1.5).with_effect("disturbance")
    assert filter_stepper(Robot().with_effect("disturbance")).scheme.substeps == 1
    assert filter_stepper(robot).scheme.substeps > 1


@pytest.fixture(scope="module")
def swum():
    random = np.random.default_rng(3)
    commands = np.stack([program(kind, 4.0, random) for kind in ("sines", "steps")], axis=1)
    return record(Robot(), commands, Noise(), random)[0]


def test_log_likelihood_gradient_and_gate(swum):
    rotor, d_rotor = commanded_residual(swum), np.ones((*swum.encoder.shape, 1))
    model = swum.encoder - rotor
    terms = encoder_terms(swum, Noise(), model, d_rotor)
    assert terms.log_likelihood == pytest.approx(norm.logpdf(rotor, scale=0.15).sum(0), rel=1e-12)
    assert terms.gradient[:, 0] == pytest.approx(-rotor.sum(0) / 0.15**2, rel=1e-9)
    assert terms.normal[:, 0, 0] == pytest.approx(terms.samples / 0.15**2)
    wrong = swum.encoder.copy()
    wrong[100, 0] = np.nan
    missing = encoder_terms(replace(swum, encoder=wrong), Noise(), model, d_rotor)
    wrong[100, 0] = 80.0
    far = encoder_terms(replace(swum, encoder=wrong), Noise(), model, d_rotor)
    wrong[100, 0] = 40.0
    near = encoder_terms(replace(swum, encoder=wrong), Noise(), model, d_rotor)
    assert far.log_likelihood == pytest.approx(near.log_likelihood)
    assert far.gradient == pytest.approx(missing.gradient)
    assert far.normal == pytest.approx(missing.normal)
    assert list(far.samples - missing.samples) == [1, 0]


def test_noise_is_not_that_of_a_few_wild_samples(swum):
    wild = swum.encoder.copy()
    wild[::40] += 60.0
    residual = commanded_residual(replace(swum, encoder=wild))
    assert encoder_noise(residual, 0.15) == pytest.approx(0.15, rel=0.12)
    assert encoder_noise(np.full(5, np.nan), 0.15) == 0.15


def test_an_encoder_worse_than_said_is_noticed_by_the_fit(swum):
    random = np.random.default_rng(4)
    rough = replace(swum, encoder=swum.encoder + 1.5 * random.standard_normal(swum.encoder.shape))
    fit = evaluate(nominal_hypothesis(Robot(), ()), np.zeros(0), rough, Noise())
    assert estimate_noise(fit, rough).encoder == pytest.approx(1.507, rel=0.1)  # with its own 0.15


NOISY_SENSORS = ("gyro", "accel", "camera_position", "camera_heading", "encoder")


@pytest.fixture(scope="module", params=[1.0, 3.0])
def factor(request):
    return request.param


@pytest.fixture(scope="module")
def swum_with_noise(factor):
    random, usual = np.random.default_rng(4), Noise()
    noisy = replace(usual, **{name: factor * getattr(usual, name) for name in NOISY_SENSORS})
    commands = np.stack([program(kind, 10.0, random) for kind in ("sines", "random")], axis=1)
    return record(Robot(), commands, noisy, random)[0]


@pytest.mark.parametrize("sensor", NOISY_SENSORS)
def test_noise_is_that_of_the_sensors(swum_with_noise, factor, sensor):
    found = getattr(usual_noise(swum_with_noise), sensor) / getattr(Noise(), sensor)
    assert found == pytest.approx(factor, rel=0.12)  # 600 poses


def test_a_smooth_signal_and_a_short_one():
    t = np.linspace(0.0, 5.0, 500)
    swing = 2.0 * np.sin(2.0 * np.pi * 2.0 * t)
    assert white_noise([(t, swing)], 0.006) == SMALLEST * 0.006
    assert white_noise([(t[:FEWEST], swing[:FEWEST])], 0.006) == 0.006
    assert white_noise([(t, np.full(500, np.nan))], 0.006) == 0.006


@pytest.mark.parametrize(("every", "expected"), [(2, 0.02), (5, 0.006)])
def test_a_slow_sensor_is_measured_as_long_as_it_follows_the_motion(every, expected):
    t, signal = 0.01 * np.arange(3000), np.full(3000, np.nan)
    signal[::every] = 0.02 * np.random.default_rng(5).standard_normal(3000 // every)
    assert white_noise([(t, signal)], 0.006) == pytest.approx(expected, rel=0.15)


@pytest.mark.parametrize("every", [1, 5])
def test_a_gyro_is_measured_fast_or_slow(swum_with_noise, every):
    """A fast one by differences of its samples; one at 20 Hz by what the IMU's own orientation says of the turn."""
    random, t = np.random.default_rng(6), DT * np.arange(swum_with_noise.length)
    kept = t[::every]
    gyro = np.full(swum_with_noise.gyro.shape, np.nan)
    noise = 0.1 * random.standard_normal((len(kept), gyro.shape[1]))
    gyro[::every] = 0.6 * np.cos(2.0 * kept)[:, None] + noise
    turned = Headings(kept, 0.3 * np.sin(2.0 * kept))
    seen = replace(swum_with_noise, gyro=gyro, headings=(turned,) * gyro.shape[1])
    assert usual_noise(seen).gyro == pytest.approx(0.1, rel=0.15)
    begun = shorten(seen, len(t) // 2)  # where a search begins
    assert usual_noise(begun).gyro == pytest.approx(0.1, rel=0.3)


@pytest.fixture(scope="module")
def fish() -> Experiment:
    """A standing wave pushes it, which the model lacks."""
    random = np.random.default_rng(4)
    commands = np.stack([program(kind, 7.0, random) for kind in ("sines", "straight")], axis=1)
    hidden = Robot().with_effect("sloshing", sine=-0.02, cosine=0.01, frequency=0.77)
    return record(hidden, commands, Noise(), random)[0]


def fitted(fish: Experiment, noise: Noise) -> Fit:
    drags = nominal_hypothesis(Robot(), ("head_drag_surge", "head_drag_sway"))
    return evaluate(drags, np.zeros(2), fish, noise)


def test_the_last_move_keeps_how_fast_the_force_changes() -> None:
    moved = NOISE_MOVES[-1](Noise(), 3.0)
    assert moved.wrench_time == pytest.approx(3.0 * Noise().wrench_time)
    rates = [np.square(n.wrench) / n.wrench_time for n in (moved, Noise())]
    np.testing.assert_allclose(*rates)


def test_a_force_thought_to_last_is_found_to_be_short(fish: Experiment) -> None:
    """From tau = 2 s at the right sigma^2 / tau: one at a time neither sigma nor tau could move."""
    short = alternate(fitted(fish, Noise()), fish)
    wrong = NOISE_MOVES[-1](short.noise, 2.0 / short.noise.wrench_time)
    long = alternate(fitted(fish, wrong), fish)
    assert long.log_posterior > short.log_posterior - 3.0
    assert long.noise.wrench_time < 1.0


@pytest.mark.parametrize("reach", [Reach.FAR, Reach.ANYWHERE])
def test_the_sensor_noise_of_the_fit_is_kept(fish: Experiment, reach: Reach) -> None:
    """The signals' roughness, from which one start takes it, would say less."""
    fit = alternate(fitted(fish, Noise()), fish)
    found = estimate_noise(replace(fit, noise=Noise()), fish, reach=reach)
    sensors = ("gyro", "accel", "camera_position", "camera_heading")
    assert [getattr(found, name) for name in sensors] == [
        getattr(Noise(), name) for name in sensors
    ]
    near = estimate_noise(fit, fish, reach=Reach.NEAR)
    values = likelihoods(fit.hypothesis, fit.theta, fish, [found, near])
    assert values[0] > values[1] - 10.0


def test_likelihoods_together_are_those_alone(fish: Experiment) -> None:
    fit = fitted(fish, Noise())
    noises = [Noise(), Noise(wrench=(0.1, 0.1, 0.001))]
    together = likelihoods(fit.hypothesis, fit.theta, fish, noises)
    alone = [evaluate(fit.hypothesis, fit.theta, fish, n).log_likelihood.sum() for n in noises]
    np.testing.assert_allclose(together, alone, rtol=1e-9)


def test_items_are_worked_on_in_their_order_and_an_error_is_raised() -> None:
    assert on_all_cores(lambda n: n * n, range(5)) == [0, 1, 4, 9, 16]
    with pytest.raises(ZeroDivisionError):
        on_all_cores(lambda n: 1 // n, [1, 0])


def test_a_parabola_leads_to_its_top_and_no_farther_than_two_octaves() -> None:
    """And no warning of NumPy reaches the user where the filter diverges."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert octaves(-1.0, 0.0, -1.0) == 0.0
        assert octaves(-4.0, 0.0, 0.0) == pytest.approx(0.5)
        assert octaves(0.0, 0.0, 5.0) == 2.0  # no top: uphill
        assert octaves(-np.inf, 0.0, 5.0) == 2.0
        assert octaves(-np.inf, 0.0, -np.inf) == 0.0
