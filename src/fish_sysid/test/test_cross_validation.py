"""What a fit gains on unseen trials: exact where all is linear, and it tells what it knows from what it had to leave open."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from fish_sim.robot import Robot
from fish_sysid.dataset.synthetic import program, record
from fish_sysid.diagnosis import cross_validation, prediction_growth
from fish_sysid.diagnosis.cross_validation import (
    gain_left_out,
    gain_unseen,
    on_all,
    predicted,
)
from fish_sysid.diagnosis.prediction_growth import holds_elsewhere
from fish_sysid.diagnosis.significance import SMALLEST_CHECK, Level
from fish_sysid.diagnosis.trial_split import Trials
from fish_sysid.estimation.ekf_types import Noise
from fish_sysid.estimation.initial_noise import OPEN
from fish_sysid.estimation.map_fit import climb, evaluate
from fish_sysid.estimation.noise_estimation import settle
from fish_sysid.estimation.parametrization import Coordinates, nominal_hypothesis

PRIOR = np.array([0.5, 4.0])


@pytest.fixture(autouse=True)
def linear(monkeypatch):
    """Fits without a robot have the prior above."""
    real = cross_validation.Coordinates
    prior = SimpleNamespace(prior=PRIOR)
    monkeypatch.setattr(
        cross_validation,
        "Coordinates",
        lambda hypothesis: real(hypothesis) if hypothesis else prior,
    )


def regression(x, y, used=(0, 1)):
    """The fit of y = x theta + unit noise at its optimum; a parameter that is not used stays 0. x: (trials, samples, 2)."""
    x = x * np.isin((0, 1), used)
    theta = np.linalg.solve(
        np.einsum("tsi,tsj->ij", x, x) + np.diag(PRIOR**-2), np.einsum("tsi,ts->i", x, y)
    )
    left = y - x @ theta
    return SimpleNamespace(
        hypothesis=None,
        theta=theta,
        log_likelihood=-0.5 * np.sum(left**2 + np.log(2 * np.pi), axis=1),
        result=SimpleNamespace(
            gradient=-np.einsum("ts,tsi->ti", left, x),
            normal=np.einsum("tsi,tsj->tij", x, x),
            whitened=left.T[..., None],
        ),
    )


def exact(x, y, held):
    """log p(y of the trials held | y of the others) of jointly Gaussian measurements."""
    others = [i for i in range(len(x)) if i not in held]

    def log_p(trials):
        rows = x[trials].reshape(-1, 2)
        covariance = rows @ np.diag(PRIOR**2) @ rows.T + np.eye(len(rows))
        return multivariate_normal.logpdf(y[trials].ravel(), cov=covariance)

    return log_p([*others, *held]) - log_p(others)


@pytest.mark.parametrize("held", [[0], [1, 3]])
def test_it_is_the_predictive_density_where_all_is_linear(held):
    random = np.random.default_rng(1)
    x = random.standard_normal((4, 10, 2))
    y = x @ np.array([0.3, -2.0]) + random.standard_normal((4, 10))
    assert predicted(regression(x, y), held) == pytest.approx(exact(x, y, held), abs=1e-6)


def test_a_fit_is_not_blamed_for_what_only_the_unseen_trials_tell_but_for_what_they_contradict():
    random = np.random.default_rng(2)
    x, noise = random.standard_normal((4, 30, 2)), random.standard_normal((4, 30))
    x[:3, :, 1] = 0.0  # only the last trial tells the second parameter
    y = x @ np.array([0.3, 2.0]) + noise
    gain, expected = gain_unseen(regression(x, y, (0,)), regression(x, y), [3])
    assert gain > 0.5 * expected > 10.0
    x = random.standard_normal((4, 30, 2))
    y = x @ np.array([0.3, 2.0]) + noise
    y[3] = x[3] @ np.array([0.3, -2.0]) + noise[3]  # the others tell it, and wrong
    assert gain_unseen(regression(x, y, (0,)), regression(x, y), [3])[0] < -10.0


def swum(robot: Robot, kinds: tuple[str, ...]):
    random = np.random.default_rng(3)
    commands = np.stack([program(kind, 5.0, random) for kind in kinds], axis=1)
    return record(robot, commands, Noise(), random)[0]


@pytest.mark.parametrize("there", [True, False])
def test_a_check_too_calm_to_tell_passes_the_question_on_to_every_trial_in_turn(there):
    """The rudder lags; straight trials say nothing of that."""
    lagging = Robot().with_effect("rudder_lag", time_constant=0.005)
    training = swum(
        lagging if there else Robot(), ("sines", "steps", "random", "straight", "straight")
    )
    searched, trials = (
        training.select([0, 1, 2]),
        Trials(training, training.select([0, 1, 2]), (3, 4)),
    )
    nominal = nominal_hypothesis(Robot())
    hypothesis = nominal.with_effect("rudder_lag", 0.3)
    start = Coordinates(hypothesis).origin()
    refitted = settle(evaluate(nominal, start[: len(nominal.free)], searched, Noise()), searched)
    base, fit = (
        on_all(refitted, training),
        settle(evaluate(hypothesis, start, searched, Noise()), searched),
    )
    gain, expected = gain_unseen(base, on_all(fit, training), trials.check)
    assert max(gain, expected) < SMALLEST_CHECK
    assert (gain_left_out(base, on_all(fit, training))[0] > 30.0) is there
    assert holds_elsewhere(base, fit, trials, 30, Level()) is there


def test_a_fit_reaches_the_optimum_of_all_trials_however_far_it_is(monkeypatch):
    """A base short of it promises a flow gains that nobody could keep: two vortices were refused so."""
    flowing = Robot().with_effect(
        "nonuniform_current", shear_x=0.2, gyre_11=0.1, gyre_21=-0.08, gyre_22=0.06
    )
    training = swum(flowing, ("sines", "turn"))
    hypothesis = nominal_hypothesis(Robot()).with_effect("nonuniform_current", 0.3)
    far = evaluate(hypothesis, Coordinates(hypothesis).origin(), training.select([0]), Noise())
    near = on_all(far, training)
    assert climb(near, training, 10).objective - near.objective < cross_validation.NEAR
    monkeypatch.setattr(cross_validation, "MOST_ITERATIONS", 3)
    assert near.objective - on_all(far, training).objective > 10.0  # it was far


def test_every_measurement_of_unseen_trials_counts(monkeypatch):
    """Behind gates a fit that has lost the fish would foretell it well."""
    monkeypatch.setattr(
        cross_validation, "evaluate", lambda hypothesis, theta, trials, noise: noise
    )
    monkeypatch.setattr(cross_validation, "climb", lambda fit, *_: fit)
    noise = on_all(
        SimpleNamespace(hypothesis=None, theta=None, noise=Noise(wrench=(1.0, 2.0, 3.0))), None
    )
    assert noise.gate_imu == noise.gate_camera == OPEN
    assert noise.wrench == (1.0, 2.0, 3.0)


@pytest.mark.parametrize(
    ("gain", "expected", "holds"),
    [(60.0, 100.0, True), (40.0, 100.0, False), (9.0, 12.0, False), (11.0, 12.0, True)],
)
def test_a_name_must_gain_half_of_what_it_would_were_it_true_and_never_little(
    monkeypatch, gain, expected, holds
):
    monkeypatch.setattr(prediction_growth, "on_all", lambda fit, _: fit)
    monkeypatch.setattr(prediction_growth, "gain_unseen", lambda *_: (gain, expected))
    assert holds_elsewhere(None, None, Trials(None, None, (0,)), 30, Level()) is holds


@pytest.mark.parametrize(
    ("names", "log_evidence", "foretold", "chosen"),
    [
        (("current", "nonuniform_current"), (50.0, 500.0), (180.0, 340.0), "nonuniform_current"),
        (
            ("current", "nonuniform_current"),
            (50.0, 500.0),
            (180.0, 185.0),
            "current",
        ),  # as good as the simpler
        (
            ("current", "nonuniform_current"),
            (500.0, 50.0),
            (180.0, 340.0),
            "current",
        ),  # the search knows better
        (("current", "tether"), (50.0, 500.0), (180.0, 340.0), "current"),  # no look-alike
    ],
)
def test_a_name_gives_way_to_the_look_alike_that_leads_everywhere_though_it_keeps_less_of_its_promise(
    monkeypatch, names, log_evidence, foretold, chosen
):
    """As a current does to a vortex, whose form the nonuniform current has only nearly."""
    fits = {
        name: SimpleNamespace(name=name, objective=e)
        for name, e in zip(names, log_evidence, strict=True)
    }
    gains = dict(zip(names, foretold, strict=True))
    monkeypatch.setattr(prediction_growth, "significant", lambda *_: list(names))
    monkeypatch.setattr(prediction_growth, "on_all", lambda fit, _: fit)
    monkeypatch.setattr(prediction_growth, "evidence", lambda fit: fit.objective)
    monkeypatch.setattr(
        prediction_growth, "holds_elsewhere", lambda base, fit, *_: fit.name == names[0]
    )
    monkeypatch.setattr(
        prediction_growth, "gain_unseen", lambda base, fit, _: (gains[fit.name], 1000.0)
    )
    base = SimpleNamespace(result=SimpleNamespace(samples=np.array([1e4])))
    found = SimpleNamespace(base=base, refitted=fits)
    assert prediction_growth.choose(found, Trials(None, None, (0,)), 30, Level()) == chosen
