"""A cold fit reaches the optimum of the truth where one way from the nominal values ends in a poor one."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from fish_sim.robot import Robot
from fish_sysid.dataset.experiment import Experiment
from fish_sysid.dataset.synthetic import program, record
from fish_sysid.diagnosis import refit
from fish_sysid.diagnosis.model_order import with_links
from fish_sysid.estimation import annealed_fit, global_fit
from fish_sysid.estimation.annealed_fit import fit_tempered
from fish_sysid.estimation.ekf_types import Noise
from fish_sysid.estimation.initial_noise import OPEN
from fish_sysid.estimation.map_fit import Fit, evaluate, likelihoods
from fish_sysid.estimation.noise_estimation import (
    SHORTEST_WRENCH,
    Reach,
    adapt_noise,
    settle,
)
from fish_sysid.estimation.parametrization import NOMINAL_FREE, Hypothesis, nominal_hypothesis


def swim(links: int, seed: int) -> tuple[Hypothesis, Experiment, Fit]:
    """A fish up to 25 % away from the nominal one, its nominal hypothesis, two trials of 4 s, the fit from the truth."""
    random = np.random.default_rng(seed)
    robot = with_links(Robot(), links)
    ratios = random.uniform(0.75, 1.25, len(NOMINAL_FREE))
    ratios[NOMINAL_FREE.index("servo_rate_limit")] = 1.0
    changed = {
        name: robot.parameters[name] * ratio
        for name, ratio in zip(NOMINAL_FREE, ratios, strict=True)
    }
    commands = np.stack([program(kind, 4.0, random) for kind in ("sines", "steps")], axis=1)
    fish = record(robot.with_parameters(**changed), commands, Noise(), random)[0]
    hypothesis = nominal_hypothesis(robot)
    return hypothesis, fish, settle(evaluate(hypothesis, np.log(ratios), fish, Noise()), fish)


def test_a_tail_of_five_links_is_fitted_as_well_as_from_the_truth() -> None:
    hypothesis, fish, true = swim(5, 0)
    single = fit_tempered(hypothesis, fish, Noise())
    assert single.objective < true.objective - 100.0
    found = global_fit.fit_multistart(hypothesis, fish, Noise())
    assert found.objective > true.objective - 3.0


def test_the_best_of_all_places_and_hops_goes_on(monkeypatch) -> None:
    """A landscape with a basin at every half: `lead` falls into the nearest one, the best lies at a given place."""
    hypothesis, origin = (
        nominal_hypothesis(Robot(), ("tail_stiffness", "rotor_inertia")),
        np.zeros(2),
    )
    best, begun = np.array([1.0, -0.5]), []

    def lead(_hypothesis, _experiment, _noise, theta, *_stages):
        begun.append(theta)
        basin = np.round(2.0 * theta) / 2.0
        return SimpleNamespace(theta=basin, noise=None, objective=-np.abs(basin - best).sum())

    monkeypatch.setattr(global_fit, "lead", lead)
    monkeypatch.setattr(global_fit, "shorten", lambda experiment, _: experiment)
    monkeypatch.setattr(global_fit, "evaluate", lambda _h, theta, *_: theta)
    monkeypatch.setattr(global_fit, "close", lambda theta, *_: theta)
    far = np.array([1.1, -0.4])
    assert np.array_equal(global_fit.fit_multistart(hypothesis, None, None, places=(far,)), best)
    starts, hops = 3, 3  # pairs of three links
    assert len(begun) == 2 + starts + hops
    assert np.array_equal(begun[0], origin)
    assert np.array_equal(begun[1], far)
    moved = np.abs(np.array(begun[-hops:]) - best)  # all from the best so far
    assert 0.0 < moved.max() < 5.0 * global_fit.HOP


def test_a_fit_that_has_no_likelihood_is_never_the_better_one() -> None:
    lost, low = SimpleNamespace(objective=np.nan), SimpleNamespace(objective=-5.0)
    assert global_fit.better(lost, low) is low
    assert global_fit.better(low, lost) is low


@pytest.mark.parametrize(
    ("links", "left", "worst", "other", "best"),
    [
        (3, 9.0, 1.0, 7.0, 7.0),
        (3, 9.0, 1.0, 3.0, 5.0),
        (3, 1.0, 1.0, 7.0, 5.0),
        (3, 1.0, 1.5, 7.0, 7.0),  # innovations that its water and sensors do not explain
        (4, 1.0, 1.0, 7.0, 7.0),
    ],
)
def test_a_fit_of_many_links_or_that_leaves_much_competes_with_one_whose_tail_is_held_at_first(
    monkeypatch, links: int, left: float, worst: float, other: float, best: float
) -> None:
    monkeypatch.setattr(global_fit, "worst_row", lambda _: worst)
    monkeypatch.setattr(global_fit, "fit_multistart", lambda *_: SimpleNamespace(objective=5.0))
    monkeypatch.setattr(global_fit, "second_look", lambda fit, *_: fit)
    monkeypatch.setattr(global_fit, "excess", lambda _: np.array([left]))

    def fit_held(*_args, held, **_keywords):
        assert held == annealed_fit.TAIL_INERTIAS
        return SimpleNamespace(objective=other)

    monkeypatch.setattr(global_fit, "fit_tempered", fit_held)
    hypothesis = SimpleNamespace(robot=SimpleNamespace(links=links))
    assert global_fit.fit_cold(hypothesis, None, None).objective == best


@pytest.mark.parametrize("sensors_are_right", [True, False])
def test_strange_innovations_are_put_down_to_the_likelier_of_sensors_and_model(
    monkeypatch, sensors_are_right: bool
) -> None:
    """A filter behind gates would not count what it cannot follow: both are judged without."""
    theirs, model = (
        SimpleNamespace(noise=Noise(gyro=1.0), theta=None),
        SimpleNamespace(noise=Noise(), theta=None),
    )
    monkeypatch.setattr(annealed_fit, "worst_row", lambda _: 9.0)
    monkeypatch.setattr(annealed_fit, "_fit_with_sensor_noise", lambda *_: theirs)
    monkeypatch.setattr(annealed_fit, "evaluate", lambda *_: model)
    monkeypatch.setattr(annealed_fit, "climb", lambda *_: model)
    monkeypatch.setattr(annealed_fit, "adapt_noise", lambda *_, **__: Noise())

    def likelihood(_hypothesis, _theta, _experiment, noise: Noise) -> float:
        assert noise.gate_imu == OPEN
        return float((noise.gyro != 1.0) == sensors_are_right)

    monkeypatch.setattr(annealed_fit, "log_posterior", likelihood)
    fit = SimpleNamespace(hypothesis=None, theta=None)
    assert annealed_fit.close(fit, None, Noise()) is (model if sensors_are_right else theirs)


@pytest.mark.parametrize(
    ("led", "here", "whole", "best"),
    [(9.0, 5.0, 70.0, 70.0), (9.0, 5.0, 30.0, 50.0), (7.0, 5.0, 70.0, 50.0)],
)
def test_a_fit_led_elsewhere_goes_on_where_it_is_ahead(monkeypatch, led, here, whole, best) -> None:
    """On shortened trials, of the fit settled there: else whole trials would be settled for nothing."""
    fit = SimpleNamespace(hypothesis=None, theta="own", noise=None, objective=50.0)
    other = SimpleNamespace(hypothesis=None, theta="led", noise=None, objective=led)
    ends = {("own", "short"): here, ("led", "whole"): whole}
    monkeypatch.setattr(refit, "evaluate", lambda _, theta, experiment, __: (theta, experiment))
    monkeypatch.setattr(
        refit, "settle_base", lambda start, _: SimpleNamespace(objective=ends[start])
    )
    assert refit.better_of(fit, other, "short", "whole").objective == best


def without_data(monkeypatch, reached: float) -> None:
    """`base` shortens, measures and evaluates nothing: where fits begin and which is kept is asked."""
    ended = SimpleNamespace(objective=reached)
    monkeypatch.setattr(
        refit, "better_of", lambda fit, *_: max(fit, ended, key=lambda one: one.objective)
    )
    monkeypatch.setattr(refit, "shorten", lambda experiment, _: experiment)
    monkeypatch.setattr(refit, "usual_noise", lambda _: None)
    monkeypatch.setattr(
        refit,
        "evaluate",
        lambda hypothesis, theta, _, noise: SimpleNamespace(
            hypothesis=hypothesis, theta=theta, noise=noise
        ),
    )


@pytest.mark.parametrize(
    ("left", "worst", "other", "best"),
    [(1.0, 1.0, 7.0, 5.0), (1.0, 1.5, 7.0, 7.0), (1.0, 1.5, 3.0, 5.0), (9.0, 1.5, 7.0, 5.0)],
)
def test_a_fit_whose_innovations_its_own_noise_does_not_explain_is_looked_at_again(
    monkeypatch, left: float, worst: float, other: float, best: float
) -> None:
    """A camera 51 ms late was fitted 8000 nats below the truth so, and not named: the check saw through the fit."""
    hypothesis = nominal_hypothesis(Robot())
    fit = SimpleNamespace(
        hypothesis=hypothesis, theta=np.full(len(hypothesis.free), 0.4), objective=5.0
    )

    def fit_held(_hypothesis, _experiment, _noise, theta, held):
        inertias = [hypothesis.free.index(name) for name in held]
        assert not theta[inertias].any()
        assert np.delete(theta, inertias) == pytest.approx(0.4)
        return SimpleNamespace(theta=theta, noise=None)

    monkeypatch.setattr(refit, "excess", lambda _: np.array([left]))
    monkeypatch.setattr(refit, "worst_row", lambda _: worst)
    without_data(monkeypatch, other)
    monkeypatch.setattr(refit, "fit_tempered", fit_held)
    assert refit.look_again(fit, None).objective == best
    assert (fit.theta == 0.4).all()


@pytest.mark.parametrize(
    ("name", "moves"), [("rudder_offset", True), ("nonuniform_current", False)]
)
def test_a_candidate_is_led_from_the_nominal_values_with_its_effect_as_found(
    monkeypatch, name, moves
) -> None:
    """One of very many numbers stays as it is until all is free on whole trials."""
    hypothesis = nominal_hypothesis(Robot(), ("tail_stiffness", "rotor_inertia")).with_effect(
        name, 0.3
    )
    effect = np.full(len(hypothesis.free) - 2, 0.8)
    begun = []

    def fit_tempered(_hypothesis, _experiment, _noise, start, held):
        begun.append((start.copy(), held))
        return SimpleNamespace(theta=start + 1.0, noise=None)

    without_data(monkeypatch, 0.0)
    monkeypatch.setattr(refit, "settle_base", lambda fit, _: fit.theta)
    monkeypatch.setattr(refit, "fit_tempered", fit_tempered)
    found = refit.led_from_nominal(hypothesis, np.array([0.6, -0.4, *effect]), None)
    ((start, held),) = begun
    assert held == annealed_fit.TAIL_INERTIAS
    np.testing.assert_allclose(start, [0.0, 0.0, *(effect if moves else ())])
    np.testing.assert_allclose(found, [1.0, 1.0, *(effect + 1.0 if moves else effect)])


def test_a_slow_strong_force_is_found_from_a_fast_one() -> None:
    """The fish lies in a current that the model has not."""
    random = np.random.default_rng(5)
    commands = np.stack([program(kind, 5.0, random) for kind in ("sines", "random")], axis=1)
    robot = Robot().with_effect(
        "nonuniform_current", mean_x=0.0, mean_y=0.0, strain=0.05, shear_x=0.2, shear_y=0.1
    )
    fish = record(robot, commands, Noise(), random)[0]
    hypothesis = nominal_hypothesis(Robot())
    fast = replace(
        Noise(), wrench=tuple(30.0 * w for w in Noise().wrench), wrench_time=SHORTEST_WRENCH
    )
    fit = evaluate(hypothesis, np.zeros(len(hypothesis.free)), fish, fast)
    slow = replace(Noise(), wrench=tuple(16.0 * w for w in Noise().wrench), wrench_time=2.0)
    found = adapt_noise(fit, fish, reach=Reach.COLD)
    of_found, of_slow, of_fast = likelihoods(hypothesis, fit.theta, fish, [found, slow, fast])
    assert of_found > of_slow > of_fast + 100.0
