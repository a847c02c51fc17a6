# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Parameters in a limit where an effect is another one are no answer, in either kind of verdict."""

from types import SimpleNamespace

import numpy as np
import pytest
from made_fits import made_fit

from fish_sim.effects import EFFECTS
from fish_sysid.diagnosis.corrected_model import named, refused, verdict
from fish_sysid.diagnosis.degenerate import LIMITS, degenerate
from fish_sysid.diagnosis.residual_regression import Law
from fish_sysid.diagnosis.significance import Level
from fish_sysid.diagnosis.vocabulary import candidates
from fish_sysid.estimation.parametrization import Parametrization, effect_class


@pytest.mark.parametrize(
    ("name", "values", "text"),
    [
        ("rudder_delay", {"delay": 0.3}, "range"),
        ("rudder_placement", {"tip_share": 1.0}, "range"),
        ("rudder_lag", {"time_constant": 0.0}, "no such effect"),
        ("tether", {"stiffness": 0.1, "length": 0.0, "x": 4.0, "y": -3.0}, "constant force"),
        ("sloshing", {"sine": 0.02, "cosine": 0.0, "frequency": 0.05}, "constant force"),
        ("wall_effect", {"k": 1.0, "length": 1.8}, "everywhere"),
        ("wake_memory", {"mobility": 0.1, "share": 0.0, "time_constant": 0.3}, "tip_slip"),
    ],
)
def test_a_limit_is_no_answer(name: str, values: dict[str, float], text: str) -> None:
    assert text in degenerate(name, values)


@pytest.mark.parametrize("name", candidates())
def test_no_effect_at_its_typical_strength_is_refused(name: str) -> None:
    effect = effect_class(name)
    values = {k: p.value for k, p in effect.parameters.items()}
    strong = {k: p.typical for k, p in effect.parameters.items() if p.typical is not None}
    assert degenerate(name, {**values, **strong}) == ""
    assert set(LIMITS) <= set(EFFECTS)


def diagnosed(**place: float):
    """A diagnosis that found a tether here, which explains everything."""
    fit = made_fit(0.0, "tether")
    free = fit.hypothesis.free
    values = {"stiffness": 0.2, "length": 0.5, "x": 0.4, "y": 0.2, **place}
    physical = [
        values[name.split(".")[1]] if name.startswith("tether.") else fit.values[name]
        for name in free
    ]
    fit = made_fit(0.0, "tether", theta=Parametrization(fit.hypothesis).encode(np.array(physical)))
    state = SimpleNamespace(law=Law({"surge": 0.0, "sway": 0.0, "yaw": 0.0}, {}, 1e4))
    task = SimpleNamespace(level=Level(), robot=fit.robot)
    accepted = (SimpleNamespace(name="tether"),)
    nominal = made_fit(0.0, ratio=100.0)
    return SimpleNamespace(
        task=task, state=state, nominal=nominal, final=fit, accepted=accepted, still_misses=None
    )


def test_a_line_made_fast_outside_the_pool_is_unexplained_and_said_to_be_a_constant_force() -> None:
    inside, outside = diagnosed(), diagnosed(x=4.0, y=-3.0)
    assert [a.name for a in named(inside)] == ["tether"]
    assert verdict(inside) == "missing_physics"
    assert named(outside) == ()
    assert verdict(outside) == "unexplained"
    assert "a constant force in the pool frame" in refused(outside)[0]
