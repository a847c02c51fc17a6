# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The compiled window against torch's autograd on the same equations, finite differences, other batches."""

import numpy as np
import pytest
from training_setup import COST, make_bank, make_batch, make_stepper, make_weights

from fish_train.training import compiled_loop
from fish_train.training.closed_loop_equations import Law
from fish_train.training.compiled_loop import CompiledLoop, fastest_loop
from fish_train.training.network import FORMS, weight_count
from fish_train.training.torch_loop import TorchLoop

compiled = pytest.mark.skipif(not CompiledLoop.available(), reason="no C compiler")
pytestmark = pytest.mark.usefixtures("shipped_flags")


def both(form: str = "network"):
    law, stepper = Law(inputs=FORMS[form].inputs), make_stepper()
    bank = make_bank(law)
    layers = FORMS[form].layers
    return (
        CompiledLoop(stepper, law, bank, layers),
        TorchLoop(stepper, law, bank, layers),
        stepper,
        bank,
    )


def relative(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.abs(a - b).max() / np.abs(b).max())


@compiled
def test_cost_gradient_and_state_agree_with_autograd() -> None:
    kernel, torch_loop, stepper, bank = both()
    rng = np.random.default_rng(1)
    weights, batch_state = make_weights("network", rng), make_batch(stepper, bank, 5, rng)
    batch_state.delay[:] = [0, 3, 1, 2, 30]
    for _ in range(2):  # the second window begins with a history and controllers that have run
        noise = 0.01 * rng.standard_normal((5, 5, 6))
        ours, theirs = batch_state.copy(), batch_state.copy()
        a = kernel.window(weights, ours, 4, COST, noise, hold=2)
        b = torch_loop.window(weights, theirs, 4, COST, noise, hold=2)
        assert a.cost == pytest.approx(b.cost, rel=1e-12)
        assert relative(a.gradient, b.gradient) < 1e-10
        assert np.allclose(a.report, b.report, atol=1e-12)
        assert np.allclose(a.applied, b.applied, atol=1e-12)
        for name, value in vars(theirs).items():
            assert np.allclose(getattr(ours, name), value, atol=1e-10), name
        batch_state = ours


@compiled
@pytest.mark.parametrize("form", ["schedule", "constant"])
def test_baseline_forms_agree_with_autograd(form: str) -> None:
    kernel, torch_loop, stepper, bank = both(form)
    rng = np.random.default_rng(2)
    weights, batch_state = make_weights(form, rng), make_batch(stepper, bank, 2, rng)
    a = kernel.window(weights, batch_state.copy(), 3, COST)
    b = torch_loop.window(weights, batch_state.copy(), 3, COST)
    assert len(weights) == weight_count(FORMS[form].layers)
    assert a.cost == pytest.approx(b.cost, rel=1e-12)
    assert relative(a.gradient, b.gradient) < 1e-10


@compiled
def test_gradient_agrees_with_finite_differences() -> None:
    kernel, _, stepper, bank = both()
    rng = np.random.default_rng(3)
    weights, batch_state = make_weights("network", rng), make_batch(stepper, bank, 8, rng)
    kernel.window(weights, batch_state, 60, COST, gradient=False)  # away from the start's symmetry
    gradient = kernel.window(weights, batch_state.copy(), 15, COST).gradient
    for _ in range(3):
        along = rng.standard_normal(len(weights))
        along /= np.linalg.norm(along)
        step = 1e-5
        costs = [
            kernel.window(
                weights + s * step * along, batch_state.copy(), 15, COST, gradient=False
            ).cost
            for s in (1.0, -1.0)
        ]
        assert (costs[0] - costs[1]) / (2.0 * step) == pytest.approx(
            gradient @ along, rel=1e-5, abs=1e-9
        )


@compiled
def test_a_batch_equals_its_fish_one_by_one() -> None:
    """11 fish: a full block and a part of one; the padding lanes count for nothing."""
    kernel, _, stepper, bank = both()
    rng = np.random.default_rng(4)
    weights, batch_state = make_weights("network", rng), make_batch(stepper, bank, 11, rng)
    together, costs, gradients = batch_state.copy(), [], []
    whole = kernel.window(weights, together, 10, COST)
    for k in range(11):
        alone = batch_state.copy()
        for name, value in vars(batch_state).items():
            setattr(alone, name, value[k : k + 1].copy())
        single = kernel.window(weights, alone, 10, COST)
        costs.append(single.cost)
        gradients.append(single.gradient)
        assert np.allclose(alone.plant[0], together.plant[k], rtol=1e-12, atol=1e-12)
    assert whole.cost == pytest.approx(np.mean(costs), rel=1e-12)
    assert relative(whole.gradient, np.mean(gradients, axis=0)) < 1e-11


def test_without_a_compiler_the_numbers_are_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    law, rng = Law(), np.random.default_rng(5)
    bank = make_bank(law)
    interpreted = make_stepper(compiled=False)
    weights, batch_state = make_weights("network", rng), make_batch(interpreted, bank, 2, rng)
    slow = TorchLoop(interpreted, law, bank).window(weights, batch_state.copy(), 4, COST)
    if CompiledLoop.available():
        fast = CompiledLoop(make_stepper(), law, bank).window(weights, batch_state.copy(), 4, COST)
        assert slow.cost == pytest.approx(fast.cost, rel=1e-12)
        assert relative(slow.gradient, fast.gradient) < 1e-10
    monkeypatch.setenv("FISH_SIM_NO_COMPILER", "1")
    assert not CompiledLoop.available()


@compiled
@pytest.mark.parametrize("width", [2, 4, 8])
def test_a_loop_that_the_compiler_gets_wrong_is_that_of_torch(
    wrong_compiler, caplog, monkeypatch, width
) -> None:
    """Wrong is the gradient alone: what travels back through the actuators. At the width of every processor."""
    law = Law(inputs="none")
    wrong_compiler("s/copy(g_actuator, NA, g->actuator)/zero(g->actuator, NA)/")
    monkeypatch.setattr(compiled_loop, "lanes", lambda: width)
    loop = fastest_loop(make_stepper(), law, make_bank(law), FORMS["constant"].layers)
    assert isinstance(loop, TorchLoop)
    assert "the slower interpreted form is used" in caplog.text


@compiled
def test_a_fish_that_is_nowhere_does_not_crash_the_kernel() -> None:
    kernel, _, stepper, bank = both()
    rng = np.random.default_rng(6)
    batch_state = make_batch(stepper, bank, 3, rng)
    batch_state.plant[1, 0] = np.nan
    result = kernel.window(make_weights("network", rng), batch_state, 5, COST)
    assert np.isnan(result.cost)
    assert np.all(np.isfinite(batch_state.plant[[0, 2]]))


def test_hold_must_divide_the_window() -> None:
    law = Law()
    bank, stepper, rng = make_bank(law), make_stepper(), np.random.default_rng(7)
    loop = TorchLoop(stepper, law, bank)
    with pytest.raises(ValueError, match="hold: got 4 for a window of 10"):
        loop.window(
            make_weights("network", rng), make_batch(stepper, bank, 1, rng), 10, COST, hold=4
        )
