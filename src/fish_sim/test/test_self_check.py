# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""A kernel that the compiler gets wrong is caught when it is built, built otherwise, and in the end not used."""

import json
import shutil
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest

from fish_sim import step
from fish_sim.effects import EFFECTS
from fish_sim.interpreted import InterpretedKernel
from fish_sim.kernel import CompiledKernel
from fish_sim.kernel_source import PARTS
from fish_sim.methods import METHODS
from fish_sim.model import Layout
from fish_sim.scheme import Scheme
from fish_sim.self_check import Sample, relative_error, run
from fish_sim.step import Stepper

SCHEME = Scheme("rk4")
GCC = shutil.which("gcc") or shutil.which("cc")

pytestmark = [
    pytest.mark.skipif(GCC is None, reason="no gcc on this computer"),
    pytest.mark.usefixtures("shipped_flags"),
]


@pytest.fixture
def cache(monkeypatch, tmp_path):
    """An empty cache on disk and in memory."""
    folder = tmp_path / "cache"
    monkeypatch.setenv("FISH_SIM_CACHE", str(folder))
    monkeypatch.delenv("FISH_SIM_NO_COMPILER", raising=False)
    monkeypatch.setenv("CC", GCC)
    step.kernel.cache_clear()
    yield folder
    step.kernel.cache_clear()


@pytest.fixture
def bad_compiler(monkeypatch, tmp_path, cache):
    """bad_compiler(edit, flag): gcc that first edits the text by this command of sed, of builds with this flag."""

    def install(edit: str, flag: str) -> None:
        script = tmp_path / "badcc"
        script.write_text(
            "#!/bin/sh\n"
            f'case " $* " in *" {flag} "*)\n'
            f"  for a; do case $a in *.c) sed -i '{edit}' \"$a\";; esac; done;;\n"
            f'esac\nexec {GCC} "$@"\n'
        )
        script.chmod(0o755)
        monkeypatch.setenv("CC", str(script))

    return install


def results(cache):
    return [json.loads(path.read_text()) for path in cache.glob("*.json")]


def one_step(batch=3):
    stepper = Stepper((1, ()), SCHEME)
    sample = Sample.draw(stepper.layout, batch)
    states = stepper.rollout(sample.states[0], sample.commands, sample.parameters)
    right = Stepper((1, ()), SCHEME, compiled=False).rollout(
        sample.states[0], sample.commands, sample.parameters
    )
    return relative_error(states[1:], right[1:])


# a coefficient of the cosine's polynomial, the weights of the stages, what is no number
EDITS = [
    "s/4.16666666666666019037e-02/4.16666766666666019037e-02/",
    "s/(h \\* B\\[i\\])/(h * B[0])/",
    "s/1.58969099521155010221e-10/(0.0 \\/ 0.0)/",
]


@pytest.mark.parametrize("part", PARTS)
def test_a_sound_kernel_is_kept_with_its_errors_and_flags(cache, part):
    kernel = step.kernel((1, (EFFECTS["rudder_lag"],)), SCHEME, 1, True, part)
    (result,) = results(cache)
    assert isinstance(kernel, CompiledKernel)
    assert result["passed"]
    assert "-fno-tree-vectorize" in result["flags"]
    assert result["errors"]
    assert max(result["errors"].values()) < 1e-11


@pytest.mark.parametrize("edit", EDITS)
def test_a_kernel_that_is_wrong_with_the_fast_flags_is_built_with_safer_ones(
    cache, bad_compiler, caplog, edit
):
    bad_compiler(edit, "-O3")
    assert one_step() < 1e-11
    (result,) = results(cache)
    assert result["passed"]
    assert result["flags"] == ["-O1"]
    assert isinstance(step.kernel((1, ()), SCHEME, step.lanes(), True, "values"), CompiledKernel)
    assert not caplog.text


@pytest.mark.parametrize(("edit", "flags"), [("", "-Og"), (EDITS[0], "-O1")])
def test_a_kernel_that_is_compiled_quickly_is_checked_too(
    cache, bad_compiler, monkeypatch, caplog, edit, flags
):
    monkeypatch.setenv("FISH_SIM_QUICK_COMPILE", "1")
    bad_compiler(edit, "-Og")
    assert one_step() < 1e-11
    (result,) = results(cache)
    assert result["passed"]
    assert result["flags"][0] == flags
    assert max(result["errors"].values()) < 1e-11
    assert not caplog.text


@pytest.mark.parametrize("batch", [1, 3])
def test_a_kernel_that_stays_wrong_is_replaced_and_the_user_is_told_once(
    cache, bad_compiler, caplog, batch
):
    bad_compiler(EDITS[0], "-shared")
    assert one_step(batch) < 1e-11
    width = 1 if batch == 1 else step.lanes()
    assert isinstance(step.kernel((1, ()), SCHEME, width, True, "values"), InterpretedKernel)
    (record,) = caplog.records
    assert record.levelname == "WARNING"
    assert "the slower interpreted form is used" in record.message
    step.kernel.cache_clear()
    assert one_step(batch) < 1e-11  # what is known to be wrong is neither built nor trusted again
    assert len(results(cache)) == 1
    assert not results(cache)[0]["passed"]


def test_a_kernel_that_loses_its_functions_is_replaced_and_the_user_is_told(
    cache, bad_compiler, caplog
):
    bad_compiler("s/^void /static void /", "-shared")
    assert one_step() < 1e-11
    (record,) = caplog.records
    assert "the slower interpreted form is used" in record.message


@pytest.mark.parametrize(("links", "scheme"), [(7, Scheme("rk4", 5)), (12, Scheme("cfmr7", 25))])
@pytest.mark.parametrize("part", ["tangents", "adjoints"])
def test_rounding_errors_stay_small_where_a_scheme_is_too_coarse_for_a_typical_fish(
    links, scheme, part
):
    """A right kernel of such a scheme is not refused: identification takes half of the simulator's steps, or fewer."""
    structure = (links, ())
    kernel = InterpretedKernel(structure, METHODS[scheme.method], scheme.substeps)
    sample = Sample.draw(Layout(structure), 3, 1).slowed(scheme)
    random = np.random.default_rng(5)
    moved = replace(
        sample,
        states=sample.states * (1.0 + 2e-16 * random.choice([-1, 0, 1], sample.states.shape)),
    )
    for name, values in run(kernel, sample, part).items():
        assert relative_error(run(kernel, moved, part)[name], values) < 1e-10, name


@pytest.mark.parametrize("part", ["tangents", "adjoints", "memory"])
def test_every_part_is_checked(cache, bad_compiler, caplog, part):
    edits = {
        "tangents": "s/dX\\[k\\] = ds\\[k\\]/dX[k] = 0.999999 * ds[k]/",
        "memory": "s/dm\\[k\\] = dm1/dm[k] = 0.9 * dm1/",
    }
    edits["adjoints"] = (
        "s/g1\\[k\\] += gw\\[2 \\* k\\] \\* SET1(c)/g1[k] += 1.000001 * gw[2 * k] * SET1(c)/"
    )
    bad_compiler(edits[part], "-shared")
    assert isinstance(
        step.kernel((1, (EFFECTS["rudder_lag"],)), SCHEME, 1, True, part), InterpretedKernel
    )
    (result,) = results(cache)
    assert not result["passed"]
    assert max(result["errors"].values()) > 1e-9


def test_a_library_without_its_result_is_not_trusted(cache, bad_compiler):
    bad_compiler(EDITS[0], "-shared")
    one_step()
    (library,), (result,) = cache.glob("*.so"), cache.glob("*.json")
    result.unlink()
    step.kernel.cache_clear()
    assert one_step() < 1e-11
    assert result.exists()
    assert library.exists()
    assert not results(cache)[0]["passed"]


def test_a_library_that_was_changed_after_its_check_is_built_again(cache):
    one_step()
    (library,), (result,) = cache.glob("*.so"), cache.glob("*.json")
    sound = library.read_bytes()
    library.unlink()
    library.write_bytes(sound[: len(sound) // 2])  # a disk that was full
    step.kernel.cache_clear()
    assert one_step() < 1e-11
    assert len(library.read_bytes()) == len(sound)
    assert json.loads(result.read_text())["passed"]


def test_threads_that_build_the_same_kernel_all_get_a_checked_one(cache):
    with ThreadPoolExecutor(4) as pool:
        errors = list(pool.map(lambda _: one_step(), range(4)))
    assert max(errors) < 1e-11
    assert len(results(cache)) == 1
    assert len(list(cache.iterdir())) == 2


@pytest.mark.parametrize("name", EFFECTS)
def test_the_check_sees_every_parameter_of_an_effect_and_nothing_that_is_no_number(name):
    """Where an adjoint is 0 for all fish of the sample, a wrong one would pass."""
    structure = (1, (EFFECTS[name],))
    layout, kernel = Layout(structure), InterpretedKernel(structure, METHODS["euler"], 1)
    sample = Sample.draw(layout, 9)
    for part in PARTS:
        for values in run(kernel, sample, part).values():
            assert np.isfinite(values).all()
    seen = np.abs(run(kernel, sample, "adjoints")["of the parameters"]).max(axis=0) > 0.0
    unseen = [
        p
        for p, s in zip(layout.parameters, seen, strict=True)
        if p.startswith(name + ".") and not s
    ]
    assert not unseen
