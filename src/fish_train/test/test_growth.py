"""A model that grows keeps the best optimum that the search came to."""

from types import SimpleNamespace

import numpy as np

from fish_train.diagnose import growth
from fish_train.diagnose.decide import Level
from fish_train.diagnose.search import Round
from fish_train.diagnose.split import Trials


def test_where_nothing_is_added_the_better_optimum_that_a_candidate_led_to_is_kept(monkeypatch):
    """A rudder's delay, rightly found, stayed 4900 nats below the optimum that the next round had come to."""

    def model(objective):
        hypothesis = SimpleNamespace(names=())
        return SimpleNamespace(
            objective=objective, hypothesis=hypothesis, result=SimpleNamespace(samples=np.array([1000.0]))
        )

    poor, better = model(0.0), model(4900.0)
    monkeypatch.setattr(growth, "settled_round", lambda *_: Round(better, (), {}))
    monkeypatch.setattr(growth, "choose", lambda *_: None)
    base, rounds, accepted = growth.grow(poor, Trials(None, None, ()), ("current",), Level(), lambda _: None)
    assert base is better and len(rounds) == 1 and not accepted
