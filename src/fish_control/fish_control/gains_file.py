# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The weights file: safetensors with the contract as JSON in its metadata."""

from __future__ import annotations

import json
import os
from pathlib import Path

import numpy as np
from safetensors import SafetensorError, safe_open
from safetensors.numpy import save

from fish_control.policy import Policy, tensor_shapes
from fish_control.policy_spec import ContractError, PolicySpec


class GainsFileError(ValueError):
    """A weights file that cannot be used; the message says what differs from what was expected."""


def write_gains_file(file: str | Path, policy: Policy) -> None:
    """Write weights and contract; the file appears whole or not at all.

    Raises:
        GainsFileError: the arrays do not fit the contract.
    """
    _check_tensors(policy, Path(file))
    metadata = {"contract": json.dumps(policy.contract.to_json(), allow_nan=False)}
    data = save(
        {name: np.ascontiguousarray(t) for name, t in policy.tensors.items()}, metadata=metadata
    )
    file = Path(file)
    new = file.with_name(f"{file.name}.{os.getpid()}.new")  # a tempfile would be for its owner only
    new.write_bytes(data)
    os.replace(new, file)


def read_gains_file(file: str | Path) -> Policy:
    """Read and check a weights file.

    Raises:
        GainsFileError: missing, not safetensors, contract not understood, arrays that do not fit it.
    """
    file = Path(file)
    try:
        with safe_open(file, framework="numpy") as stream:
            metadata = stream.metadata() or {}
            tensors = {name: stream.get_tensor(name) for name in stream.keys()}
    except OSError as error:
        raise GainsFileError(
            f"weights file {file}: cannot be read: {error.strerror or error}"
        ) from error
    except SafetensorError as error:
        raise GainsFileError(f"weights file {file}: not a safetensors file ({error})") from error
    except TypeError as error:
        raise GainsFileError(
            f"weights file {file}: numpy has no such arrays ({error}), expected float64"
        ) from error
    if "contract" not in metadata:
        raise GainsFileError(
            f"weights file {file}: no contract in its metadata; was it written by write_gains_file?"
        )
    try:
        policy = Policy(PolicySpec.from_json(json.loads(metadata["contract"])), tensors)
    except (ContractError, json.JSONDecodeError) as error:
        raise GainsFileError(f"weights file {file}: {error}") from error
    _check_tensors(policy, file)
    return policy


def require_fit(
    policy: Policy, file: str | Path, control_period: float, lookahead: float, robot_hash: str = ""
) -> None:
    """Refuse a policy that was made for another controller or robot.

    Raises:
        GainsFileError: lists every difference.
    """
    differences = policy.contract.differences(control_period, lookahead, robot_hash)
    if differences:
        raise GainsFileError(f"weights file {file} does not fit: {'; '.join(differences)}")


def _check_tensors(policy: Policy, file: Path) -> None:
    expected = tensor_shapes(policy.contract)
    came = {name: tensor.shape for name, tensor in policy.tensors.items()}
    if came != expected:
        names = sorted(n for n in {*came, *expected} if came.get(n) != expected.get(n))
        said = "; ".join(
            f"{n} is {came.get(n, 'missing')}, expected {expected.get(n, 'none')}" for n in names
        )
        raise GainsFileError(f"weights file {file}: arrays do not fit the contract: {said}")
    for name, tensor in policy.tensors.items():
        if not np.all(np.isfinite(tensor)):
            raise GainsFileError(f"weights file {file}: {name} has values that are not finite")
    if not policy.contract.layers:
        for value, output in zip(policy.tensors["gains"], policy.contract.outputs, strict=True):
            if not output.low <= value <= output.high:
                span = f"[{output.low:g}, {output.high:g}]"
                raise GainsFileError(
                    f"weights file {file}: {output.name} is {value:g}, expected within {span}"
                )
