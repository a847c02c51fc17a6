"""The search does not mistake a poor optimum for missing physics, and refits what looks like the winner."""

from types import SimpleNamespace

import numpy as np
import pytest

from fish_sim.robot import Robot
from fish_sysid.dataset.synthetic import program, record
from fish_sysid.diagnosis import forward_selection, refit, screening
from fish_sysid.diagnosis.significance import TEMPER, probabilities
from fish_sysid.estimation.ekf_types import Noise
from fish_sysid.estimation.map_fit import evaluate
from fish_sysid.estimation.noise_estimation import settle
from fish_sysid.estimation.parametrization import nominal_hypothesis


def quiet(_: str) -> None:
    pass


@pytest.mark.parametrize(
    ("gain", "restarted", "kept", "searches"),
    [(100.0, 90.0, 90.0, 2), (100.0, 10.0, 10.0, 1), (20.0, 19.0, 0.0, 1)],
)
def test_a_base_that_a_candidate_improves_is_searched_again(
    monkeypatch, gain, restarted, kept, searches
):
    bases = []

    def searched(base, *_):
        bases.append(base.objective)
        return forward_selection.Round(base, (), {"current": SimpleNamespace(objective=gain)})

    better = SimpleNamespace(objective=restarted)
    monkeypatch.setattr(forward_selection, "evidence", lambda fit: fit.objective)
    monkeypatch.setattr(forward_selection, "search_round", searched)
    monkeypatch.setattr(
        forward_selection, "restart_base", lambda base, *_: forward_selection.better(base, better)
    )
    found = forward_selection.settled_round(
        SimpleNamespace(objective=0.0), {"current": 23.0}, None, quiet
    )
    assert bases == [0.0, restarted][:searches]
    assert (
        found.base.objective == kept
    )  # what gains too little for a name tells nothing of the base


@pytest.mark.parametrize("ahead", [True, False])
def test_a_base_is_restarted_on_whole_trials_only_where_that_leads_on_shortened_ones(
    monkeypatch, ahead
):
    """Both are settled there: parameters and noise fitted to the shortened trials alone gain a little anyway."""
    settled = []

    def settle(fit, trials):
        settled.append((trials, *fit.theta))
        return SimpleNamespace(
            theta=fit.theta, noise=fit.noise, objective=130.0 if ahead and any(fit.theta) else 100.0
        )

    for module in (forward_selection, refit):
        monkeypatch.setattr(
            module,
            "evaluate",
            lambda _, theta, __, noise: SimpleNamespace(theta=theta, noise=noise),
        )
        monkeypatch.setattr(module, "settle_base", settle)
    monkeypatch.setattr(forward_selection, "shorten", lambda *_: "short")
    monkeypatch.setattr(forward_selection, "log_posterior", lambda _, theta, trials, noise: 100.0)
    own = SimpleNamespace(hypothesis=None, theta=np.zeros(1), noise="its own", objective=100.0)
    rival = SimpleNamespace(theta=np.ones(2), noise="the rival's")
    found = forward_selection.restart_base(own, rival, "whole")
    assert settled == [("short", 1.0), ("short", 0.0), *([("whole", 1.0)] if ahead else [])]
    assert (found is own) is not ahead
    assert not ahead or (found.theta == 1.0).all()


def test_what_gains_far_less_than_it_needs_itself_or_no_more_than_chance_is_not_refitted(
    monkeypatch,
):
    ranked = tuple(
        screening.Ranked(name, 29.0, np.zeros(1)) for name in ("nonuniform_current", "sloshing")
    )
    monkeypatch.setattr(forward_selection, "rank", lambda *_: ranked)
    monkeypatch.setattr(forward_selection, "excess", lambda _: np.ones(3))
    monkeypatch.setattr(forward_selection, "refit", lambda *_: SimpleNamespace(objective=29.0))
    monkeypatch.setattr(forward_selection, "evidence", lambda fit: fit.objective)
    needed = {"nonuniform_current": 82.0, "sloshing": 30.0}
    found = forward_selection.search_round(SimpleNamespace(objective=0.0), needed, None, quiet)
    assert set(found.refitted) == {"sloshing"}


@pytest.mark.parametrize(
    ("left", "ranking_gain", "refit_gain", "afar"),
    [
        (2000.0, 900.0, 900.0, True),
        (10.0, 900.0, 900.0, False),
        (40.0, -64.0, 900.0, False),
        (40.0, 13.0, -2.0, False),
    ],
)
def test_where_the_base_leaves_a_force_that_no_pool_has_candidates_are_led_from_the_nominal_values(
    monkeypatch, left, ranking_gain, refit_gain, afar
):
    """A rudder that stops was found otherwise, but left 2300 times usual water, as its base did: nothing was named.

    A payload and a camera's scale were not found so beside a base that left 47 and 36 times usual water, and are from near.
    """
    hypothesis = nominal_hypothesis(Robot(), ("tail_stiffness",))
    base = SimpleNamespace(hypothesis=hypothesis, objective=0.0, noise=None)
    gains = {"rudder_lag": ranking_gain, "rudder_gain": 900.0}
    ranked = {kind: (screening.Ranked(kind, gain, np.zeros(2)),) for kind, gain in gains.items()}
    monkeypatch.setattr(forward_selection, "excess", lambda _: np.array([1.0, left, 1.0]))
    monkeypatch.setattr(forward_selection, "rank_afar", lambda *_: ranked["rudder_lag"])
    monkeypatch.setattr(forward_selection, "rank", lambda *_: ranked["rudder_gain"])
    monkeypatch.setattr(
        forward_selection, "led_from_nominal", lambda *_: SimpleNamespace(objective=refit_gain)
    )
    monkeypatch.setattr(forward_selection, "evaluate", lambda *_: None)
    monkeypatch.setattr(forward_selection, "adapt_noise", lambda *_: None)
    monkeypatch.setattr(forward_selection, "settle", lambda *_: None)
    monkeypatch.setattr(
        forward_selection, "look_again", lambda *_: SimpleNamespace(objective=800.0)
    )
    monkeypatch.setattr(forward_selection, "evidence", lambda fit: fit.objective)
    found = forward_selection.search_round(
        base, {"rudder_lag": 23.0, "rudder_gain": 23.0}, None, quiet
    )
    gains = {name: fit.objective for name, fit in found.refitted.items()}
    assert gains == ({"rudder_lag": 900.0} if afar else {"rudder_gain": 800.0})


def test_of_those_that_the_camera_led_two_are_refitted_and_of_very_many_numbers_only_the_best():
    def names(**gains):
        ranked = [screening.Ranked(name, gain, np.zeros(1)) for name, gain in gains.items()]
        return [r.name for r in forward_selection.led_shortlist(ranked)]

    assert names(nonuniform_current=700.0, current=650.0, tether=600.0) == [
        "nonuniform_current",
        "current",
    ]
    assert names(current=700.0, nonuniform_current=650.0, tether=600.0) == ["current", "tether"]
    assert names(current=700.0, tether=100.0) == ["current"]


def test_a_look_alike_is_refitted_from_where_the_winner_led():
    random = np.random.default_rng(2)
    truth = Robot().with_effect("tip_slip", mobility=1.0 / 6.0)
    commands = np.stack([program(kind, 8.0, random) for kind in ("sines", "steps")], axis=1)
    experiment = record(truth, commands, Noise(), random)[0]
    base = evaluate(
        nominal_hypothesis(Robot(), ("tail_stiffness",)), np.zeros(1), experiment, Noise()
    )
    wake = base.hypothesis.with_effect("wake_memory", screening.SCALE)
    best = settle(evaluate(wake, np.array([0.0, 1.0, 0.0, 0.0]), experiment, Noise()), experiment)
    slip = forward_selection.refit_beside(best, base, "tip_slip", experiment, 20.0)
    assert slip is not None
    assert slip.objective > best.objective - 10.0
    assert slip.values["tip_slip.mobility"] == pytest.approx(1.0 / 6.0, rel=0.05)
    assert (
        forward_selection.refit_beside(best, base, "tail_joint_damping", experiment, 20.0) is None
    )
    odds = probabilities(
        {
            "slip": forward_selection.evidence(slip, TEMPER),
            "wake": forward_selection.evidence(best, TEMPER),
        }
    )
    assert odds["slip"] > 0.7  # two numbers more that nothing asks for
