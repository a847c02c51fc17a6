"""A model that grows keeps the best optimum that the search came to, and prefers a name to a law that foretells no better."""

from types import SimpleNamespace

import numpy as np
import pytest

from fish_sysid.diagnosis import prediction_growth
from fish_sysid.diagnosis.forward_selection import Round
from fish_sysid.diagnosis.residual_regression import Description
from fish_sysid.diagnosis.significance import Level
from fish_sysid.diagnosis.trial_split import Trials


def test_where_nothing_is_added_the_better_optimum_that_a_candidate_led_to_is_kept(monkeypatch):
    """A rudder's delay, rightly found, stayed 4900 nats below the optimum that the next round had come to."""

    def model(objective):
        hypothesis = SimpleNamespace(names=())
        return SimpleNamespace(
            objective=objective,
            hypothesis=hypothesis,
            result=SimpleNamespace(samples=np.array([1000.0])),
        )

    poor, better = model(0.0), model(4900.0)
    monkeypatch.setattr(prediction_growth, "settled_round", lambda *_: Round(better, (), {}))
    monkeypatch.setattr(prediction_growth, "choose", lambda *_: None)
    base, rounds, accepted = prediction_growth.grow(
        poor, Trials(None, None, ()), ("current",), Level(), lambda _: None
    )
    assert base is better
    assert len(rounds) == 1
    assert not accepted


@pytest.mark.parametrize(
    ("law", "wave_drag", "promised", "named"),
    [
        (34.0, 38.0, 50.0, ["wave_drag"]),  # as good as the law
        (34.0, 38.0, 90.0, []),  # but it does not keep half of what it promises
        (90.0, 38.0, 50.0, []),  # the law foretells what no name does
        (34.0, 28.0, 50.0, []),  # chance might foretell as much, with 30 names tried
        (20.0, 38.0, 50.0, []),  # nothing is left
    ],
)
def test_a_name_that_foretells_as_well_as_the_law_of_what_is_left_takes_its_place(
    monkeypatch, law, wave_drag, promised, named
):
    """A hump of drag at a speed hardly reached had gained 28 nats on the searched trials, of 34 that were asked."""
    fits = {
        name: SimpleNamespace(name=name, objective=28.0) for name in ("quadratic_drag", "wave_drag")
    }
    base = SimpleNamespace(name="base")
    foretold = {"quadratic_drag": wave_drag - 2.0, "wave_drag": wave_drag}
    monkeypatch.setattr(prediction_growth, "on_all", lambda fit, _: fit)
    monkeypatch.setattr(prediction_growth, "strength_z", lambda *_: 8.0)
    monkeypatch.setattr(prediction_growth, "evidence", lambda fit: foretold[fit.name])
    left = Description({"surge": law, "sway": 0.0, "yaw": 1.0}, {}, 1e4)
    monkeypatch.setattr(
        prediction_growth, "gain_left_out", lambda base, fit: (foretold[fit.name], promised)
    )
    found = Round(base, tuple(range(30)), fits)
    told: list[str] = []
    accepted = prediction_growth.instead_of_a_law(
        found, left, Trials(None, None, (0,)), Level(), told.append
    )
    assert [a.name for a in accepted] == named
    assert all(a.foretold == wave_drag and a.contest == fits for a in accepted)
    assert [line.split()[1] for line in told] == named


def test_where_nothing_was_refitted_the_law_stays(monkeypatch):
    """No candidate was promising enough to be fitted: none can take the law's place."""
    monkeypatch.setattr(
        prediction_growth, "on_all", lambda *_: pytest.fail("nothing to compare the law with")
    )
    left, nothing = (
        Description({"surge": 34.0, "sway": 0.0, "yaw": 1.0}, {}, 1e4),
        Round(None, (), {}),
    )
    assert not prediction_growth.instead_of_a_law(
        nothing, left, Trials(None, None, (0,)), Level(), lambda _: None
    )
