"""The search does not mistake a poor optimum for missing physics, and refits what looks like the winner."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from fish_sim.robot import Robot
from fish_train.diagnose import ranking, search
from fish_train.diagnose.decide import TEMPER, probabilities
from fish_train.identify.adapt import settle
from fish_train.identify.filter_types import Noise
from fish_train.identify.fit import evaluate
from fish_train.identify.hypothesis import nominal_hypothesis
from fish_train.identify.synthetic import program, record


def quiet(_: str) -> None:
    pass


@pytest.mark.parametrize(
    ("gain", "restarted", "kept", "searches"),
    [(100.0, 90.0, 90.0, 2), (100.0, 10.0, 10.0, 1), (20.0, 19.0, 0.0, 1)],
)
def test_a_base_that_a_candidate_improves_is_searched_again(monkeypatch, gain, restarted, kept, searches):
    bases = []

    def searched(base, *_):
        bases.append(base.objective)
        return search.Round(base, (), {"current": SimpleNamespace(objective=gain)})

    better = SimpleNamespace(objective=restarted)
    monkeypatch.setattr(search, "evidence", lambda fit: fit.objective)
    monkeypatch.setattr(search, "search_round", searched)
    monkeypatch.setattr(search, "restart_base", lambda base, *_: search.better(base, better))
    found = search.settled_round(SimpleNamespace(objective=0.0), {"current": 23.0}, None, quiet)
    assert bases == [0.0, restarted][:searches]
    assert found.base.objective == kept  # what gains too little for a name tells nothing of the base


def test_what_gains_far_less_than_it_needs_itself_or_no_more_than_chance_is_not_refitted(monkeypatch):
    ranked = tuple(ranking.Ranked(name, 29.0, np.zeros(1)) for name in ("nonuniform_current", "sloshing"))
    monkeypatch.setattr(search, "rank", lambda *_: ranked)
    monkeypatch.setattr(search, "refit", lambda *_: SimpleNamespace(objective=29.0))
    monkeypatch.setattr(search, "evidence", lambda fit: fit.objective)
    needed = {"nonuniform_current": 82.0, "sloshing": 30.0}
    found = search.search_round(SimpleNamespace(objective=0.0), needed, None, quiet)
    assert set(found.refitted) == {"sloshing"}


@pytest.mark.parametrize(
    ("left", "cold", "asked", "best"),
    [(2000.0, 4000.0, ["rudder_saturation"], 4000.0), (2000.0, 1010.0, ["rudder_saturation"], 1000.0),
     (10.0, 4000.0, [], 1000.0)],
)  # fmt: skip
def test_the_best_candidate_is_led_from_afar_where_it_leaves_a_force_that_no_pool_has(
    monkeypatch, left, cold, asked, best
):
    """A rudder that stops was found so, but left 2300 times usual water, as its base did: nothing was named."""
    fits = {"rudder_saturation": 1000.0, "rudder_gain": 900.0, "rudder_offset": 100.0}
    fits = {name: SimpleNamespace(objective=objective) for name, objective in fits.items()}
    beside = {"rudder_gain": SimpleNamespace(objective=3000.0), "rudder_offset": None}
    calls = []

    def anew(fit, _):
        calls.extend(name for name in fits if fits[name] is fit)
        return SimpleNamespace(objective=cold)

    monkeypatch.setattr(search, "evidence", lambda fit: fit.objective)
    monkeypatch.setattr(search, "excess", lambda _: np.array([1.0, left, 1.0]))
    monkeypatch.setattr(search, "from_nominal", anew)
    monkeypatch.setattr(search, "refit_beside", lambda led, base, name, *_: beside[name])
    found = search.Round(SimpleNamespace(objective=0.0), (), fits)
    led = search.from_afar(found, None, 23.0, quiet)
    assert calls == asked and led.best == "rudder_saturation"
    assert led.refitted["rudder_saturation"].objective == best
    assert led.refitted["rudder_gain"].objective == (3000.0 if best > 1000.0 else 900.0)
    assert led.refitted["rudder_offset"] is fits["rudder_offset"]  # so far behind that it was not refitted
    nothing = search.from_afar(replace(found, base=SimpleNamespace(objective=990.0)), None, 23.0, quiet)
    assert nothing.refitted is fits and calls == asked  # what gains too little for a name is left alone


def test_a_look_alike_is_refitted_from_where_the_winner_led():
    random = np.random.default_rng(2)
    truth = Robot().with_effect("tip_slip", mobility=1.0 / 6.0)
    commands = np.stack([program(kind, 8.0, random) for kind in ("sines", "steps")], axis=1)
    experiment = record(truth, commands, Noise(), random)[0]
    base = evaluate(nominal_hypothesis(Robot(), ("tail_stiffness",)), np.zeros(1), experiment, Noise())
    wake = base.hypothesis.with_effect("wake_memory", ranking.SCALE)
    best = settle(evaluate(wake, np.array([0.0, 1.0, 0.0, 0.0]), experiment, Noise()), experiment)
    slip = search.refit_beside(best, base, "tip_slip", experiment, 20.0)
    assert slip is not None and slip.objective > best.objective - 10.0  # wake_memory holds tip_slip within it
    assert slip.values["tip_slip.mobility"] == pytest.approx(1.0 / 6.0, rel=0.05)
    assert search.refit_beside(best, base, "tail_joint_damping", experiment, 20.0) is None
    odds = probabilities({"slip": search.evidence(slip, TEMPER), "wake": search.evidence(best, TEMPER)})
    assert odds["slip"] > 0.7  # two numbers more that nothing asks for
