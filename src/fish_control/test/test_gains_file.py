# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The weights file: round trip, inference, and what differs when it does not fit."""

import json
import os
from dataclasses import replace

import numpy as np
import pytest
from safetensors.numpy import load_file, save_file

from fish_control.control_law import Gains
from fish_control.gains_file import GainsFileError, read_gains_file, require_fit, write_gains_file
from fish_control.policy import Policy, policy_inputs, tensor_shapes
from fish_control.policy_spec import HIDDEN, INPUTS, ContractError, PolicySpec

CONSTANT = Gains(0.3, 0.4, 0.03, 0.6, 0.07, 0.0)


@pytest.fixture
def network():
    rng = np.random.default_rng(0)
    contract = PolicySpec(training_seed=7, robot_hash="abc", note="test")
    tensors = {name: rng.normal(0.0, 0.2, shape) for name, shape in tensor_shapes(contract).items()}
    return Policy(contract, tensors)


def rewritten(file, change_contract=None, change_tensors=None):
    """The file with its contract or tensors changed behind the writer's back."""
    tensors = dict(load_file(file))
    contract = read_gains_file(file).contract.to_json()
    if change_contract:
        contract = json.loads(json.dumps(contract))
        change_contract(contract)
    if change_tensors:
        change_tensors(tensors)
    save_file(tensors, file, metadata={"contract": json.dumps(contract)})
    return file


def test_a_network_survives_the_file(network, tmp_path):
    write_gains_file(tmp_path / "w.safetensors", network)
    again = read_gains_file(tmp_path / "w.safetensors")
    assert again.contract == network.contract
    x = np.random.default_rng(1).normal(size=(5, 6))
    np.testing.assert_array_equal(again.gains(x), network.gains(x))


def test_constant_gains_are_the_same_format(tmp_path):
    write_gains_file(tmp_path / "c.safetensors", Policy.constant(CONSTANT))
    policy = read_gains_file(tmp_path / "c.safetensors")
    assert policy.contract.layers == ()
    assert policy.gains(np.zeros(6)) == pytest.approx(CONSTANT)
    assert policy.gains(np.zeros((3, 6))).speed_kp.shape == (3,)


def test_network_is_relu_then_tanh_scaled_to_the_ranges(network):
    x = np.random.default_rng(2).normal(size=6)
    h = x
    for k in range(3):
        w, b = network.tensors[f"layers.{k}.weight"], network.tensors[f"layers.{k}.bias"]
        h = np.array(
            [max(sum(w[i, j] * h[j] for j in range(len(h))) + b[i], 0.0) for i in range(len(b))]
        )
    raw = network.tensors["layers.3.weight"] @ h + network.tensors["layers.3.bias"]
    high = np.array([1.0, 1.0, 1.0, 2.5, 0.1, 0.1])
    np.testing.assert_allclose(network.gains(x), high / (1.0 + np.exp(-2.0 * raw)), rtol=1e-12)


def test_gains_stay_in_their_ranges_for_any_input(network):
    gains = np.array(network.gains(np.random.default_rng(3).normal(0.0, 100.0, (1000, 6))))
    low = np.array([o.low for o in network.contract.outputs])
    high = np.array([o.high for o in network.contract.outputs])
    assert np.all(gains.T >= low)
    assert np.all(gains.T <= high)


def test_network_has_the_papers_layers(network):
    assert HIDDEN == (6, 128, 128, 64, 6)
    assert (
        sum(t.size for t in network.tensors.values())
        == 6 * 128 + 128 + 128 * 128 + 128 + 128 * 64 + 64 + 64 * 6 + 6
    )


def test_inputs_are_normalised_in_the_papers_order():
    values = [2.0 * np.pi + 0.3, 0.15, 0.2, -0.25, 0.05, 0.02]
    expected = [0.3 / np.pi, 0.5, 0.2 / 0.3, -0.5, 0.5, 0.2]
    assert [i.name for i in INPUTS][:3] == ["head_angle", "surge_speed", "desired_speed"]
    np.testing.assert_allclose(policy_inputs(*values, np), expected, atol=1e-12)


def test_missing_file(tmp_path):
    with pytest.raises(GainsFileError, match=r"nowhere.safetensors: cannot be read"):
        read_gains_file(tmp_path / "nowhere.safetensors")


@pytest.mark.parametrize("content", [b"", b"hello", b"\xff" * 200])
def test_file_that_is_no_safetensors(tmp_path, content):
    (tmp_path / "x.safetensors").write_bytes(content)
    with pytest.raises(GainsFileError, match="not a safetensors file"):
        read_gains_file(tmp_path / "x.safetensors")


def test_truncated_file(network, tmp_path):
    file = tmp_path / "w.safetensors"
    write_gains_file(file, network)
    file.write_bytes(file.read_bytes()[:-100])
    with pytest.raises(GainsFileError, match="not a safetensors file"):
        read_gains_file(file)


def test_file_without_contract(tmp_path):
    save_file({"gains": np.zeros(6)}, tmp_path / "x.safetensors")
    with pytest.raises(GainsFileError, match="no contract"):
        read_gains_file(tmp_path / "x.safetensors")


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (
            lambda c: c.update(format_version=1),
            "version 1, expected 'fish_control/gains' version 3",
        ),
        (lambda c: c.pop("lookahead"), "contract lacks lookahead"),
        (lambda c: c.update(colour="red"), "contract has unknown colour"),
        (lambda c: c["limits"].pop("rudder_range"), "limits lacks rudder_range"),
        (lambda c: c["limits"].update(rudder_range=-1.0), "rudder_range is -1.0"),
        (lambda c: c["outputs"][0].update(name="kp"), "outputs are"),
        (lambda c: c.update(layers=[6, 128, 5]), "expected 6 inputs first and 6 gains last"),
        (lambda c: c.update(layers=[6, 6]), "layers.1.weight is"),
        (lambda c: c.update(activation="tanh"), "activation is 'tanh', expected 'relu'"),
        (lambda c: c["inputs"][1].update(scale=0.0), "input surge_speed has scale 0.0"),
        (lambda c: c.update(layers=None), "layers is None, expected a list"),
        (
            lambda c: c.update(layers=[6]),
            r"layers are \[6\], expected 6 inputs first and 6 gains last",
        ),
        (
            lambda c: c.update(layers=[6, 8.0, 6]),
            r"layers are \[6, 8.0, 6\], expected whole numbers > 0",
        ),
        (lambda c: c.update(inputs=3), "inputs is 3, expected a list"),
        (lambda c: c.update(inputs=[3]), "input is 3, expected an object"),
        (lambda c: c.update(outputs="all"), "outputs is 'all', expected a list"),
        (lambda c: c.update(limits=None), "limits is None, expected an object"),
        (
            lambda c: c["limits"].update(rudder_range="wide"),
            "limits: rudder_range is 'wide', expected a number",
        ),
        (
            lambda c: c["guidance"].update(slip_arm=None),
            "guidance: slip_arm is None, expected a number",
        ),
        (
            lambda c: c["guidance"].update(learn_current=1),
            "learn_current is 1, expected true or false",
        ),
        (lambda c: c["inputs"][1].update(scale="1"), "input: scale is '1', expected a number"),
        (lambda c: c.update(lookahead=True), "lookahead is True, expected a number"),
        (lambda c: c.update(robot_hash=5), "robot_hash is 5, expected a text"),
    ],
)
def test_contract_that_differs_says_what(network, tmp_path, change, said):
    write_gains_file(tmp_path / "w.safetensors", network)
    with pytest.raises(GainsFileError, match=said):
        read_gains_file(rewritten(tmp_path / "w.safetensors", change_contract=change))


def test_one_layer_is_no_network_even_without_arrays(tmp_path):
    file = tmp_path / "w.safetensors"
    write_gains_file(file, Policy.constant(CONSTANT))
    with pytest.raises(GainsFileError, match=r"layers are \[6\], expected 6 inputs first"):
        read_gains_file(rewritten(file, lambda c: c.update(layers=[6]), lambda t: t.pop("gains")))


@pytest.mark.parametrize(("umask", "mode"), [(0o022, 0o644), (0o002, 0o664), (0o077, 0o600)])
def test_a_written_file_is_for_those_whom_the_umask_leaves(tmp_path, umask, mode):
    before = os.umask(umask)
    try:
        write_gains_file(tmp_path / "w.safetensors", Policy.constant(CONSTANT))
    finally:
        os.umask(before)
    assert (tmp_path / "w.safetensors").stat().st_mode & 0o777 == mode
    assert [f.name for f in tmp_path.iterdir()] == ["w.safetensors"]


def test_arrays_that_numpy_does_not_know_are_refused(tmp_path):
    contract = json.dumps(PolicySpec(layers=()).to_json())
    gains = {"dtype": "BF16", "shape": [6], "data_offsets": [0, 12]}
    header = json.dumps({"__metadata__": {"contract": contract}, "gains": gains}).encode()
    file = tmp_path / "w.safetensors"
    file.write_bytes(len(header).to_bytes(8, "little") + header + bytes(12))
    with pytest.raises(GainsFileError, match=r"bfloat16.*expected float64"):
        read_gains_file(file)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda t: t.pop("layers.2.bias"), "layers.2.bias is missing, expected \\(64,\\)"),
        (lambda t: t.update(extra=np.zeros(2)), "extra is \\(2,\\), expected none"),
        (
            lambda t: t["layers.0.weight"].__setitem__((0, 0), np.nan),
            "layers.0.weight has values that are not finite",
        ),
    ],
)
def test_arrays_that_differ_say_which(network, tmp_path, change, said):
    write_gains_file(tmp_path / "w.safetensors", network)
    with pytest.raises(GainsFileError, match=said):
        read_gains_file(rewritten(tmp_path / "w.safetensors", change_tensors=change))


def test_constant_gain_out_of_range_is_refused(tmp_path):
    with pytest.raises(GainsFileError, match="speed_kp is 9, expected within"):
        write_gains_file(
            tmp_path / "c.safetensors", Policy.constant(CONSTANT._replace(speed_kp=9.0))
        )


def test_every_difference_to_the_controller_is_listed(network):
    with pytest.raises(GainsFileError) as refusal:
        require_fit(network, "w.safetensors", 0.01, 0.3, "def")
    for said in ("control period is 0.02", "runs at 0.01", "lookahead is 0.4", "robot hash is abc"):
        assert said in str(refusal.value)
    require_fit(network, "w.safetensors", 0.02, 0.4, "abc")
    require_fit(network, "w.safetensors", 0.02, 0.4)


def test_other_inputs_are_refused():
    contract = PolicySpec(inputs=tuple(replace(i, name=i.name + "_x") for i in INPUTS))
    assert "inputs are" in contract.differences(0.02, 0.4)[0]


def test_contract_survives_json():
    contract = PolicySpec(training_seed=3, note="n")
    assert PolicySpec.from_json(json.loads(json.dumps(contract.to_json()))) == contract
    with pytest.raises(ContractError, match="expected an object"):
        PolicySpec.from_json([1])
