# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What a weights file promises and a controller expects: the contract between training and robot."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields
from typing import Any

from fish_control.control_law import ControlLimits, Gains
from fish_control.line_of_sight import GuidanceConfig

FORMAT = "fish_control/gains"
FORMAT_VERSION = 3
HIDDEN = (6, 128, 128, 64, 6)  # the paper's policy; () in a contract means constant gains
_KINDS: dict[
    str, tuple[tuple[type, ...], str]
] = {  # what may stand in JSON for a field, by its annotation
    "float": ((int, float), "a number"),
    "bool": ((bool,), "true or false"),
    "str": ((str,), "a text"),
    "int | None": ((int, type(None)), "a whole number or null"),
    "tuple[int, ...]": ((list, tuple), "a list of whole numbers"),
    "tuple[Input, ...]": ((list, tuple), "a list of inputs"),
    "tuple[Output, ...]": ((list, tuple), "a list of outputs"),
}


@dataclass(frozen=True)
class Input:
    """One input of the policy: (value - offset) / scale."""

    name: str
    unit: str
    scale: float
    offset: float = 0.0


@dataclass(frozen=True)
class Output:
    """One gain: low + (high - low) (tanh + 1) / 2."""

    name: str
    low: float
    high: float


INPUTS = (
    Input("head_angle", "rad", math.pi),  # mean heading over the stroke, wrapped to +-pi
    Input("surge_speed", "m/s", 0.3),
    Input("desired_speed", "m/s", 0.3),
    Input("heading_error", "rad", 0.5),
    Input("speed_error", "m/s", 0.1),
    Input("cross_track_error", "m", 0.1),
)

OUTPUTS = (  # the paper's ranges, for this project's errors (rad, m/s) and output scales (ControlLimits)
    Output("steering_kp", 0.0, 1.0),
    Output("steering_ki", 0.0, 1.0),
    Output("steering_kd", 0.0, 1.0),
    Output("speed_kp", 0.0, 2.5),
    Output("speed_ki", 0.0, 0.1),
    Output("speed_kd", 0.0, 0.1),
)


class ContractError(ValueError):
    """A contract that cannot be understood; says the field, what came and what was expected."""


@dataclass(frozen=True)
class PolicySpec:
    """Everything but the weights that decides what the controller does with them."""

    layers: tuple[int, ...] = HIDDEN  # sizes with input and output; () for constant gains
    inputs: tuple[Input, ...] = INPUTS
    outputs: tuple[Output, ...] = OUTPUTS
    activation: str = "relu"
    control_period: float = 0.02  # s
    lookahead: float = 0.4  # m
    limits: ControlLimits = field(default_factory=ControlLimits)
    guidance: GuidanceConfig = field(default_factory=GuidanceConfig)
    robot_hash: str = ""  # of the robot it was trained on; empty: any
    training_seed: int | None = None
    note: str = ""

    def __post_init__(self) -> None:
        ends = (len(self.inputs), len(self.outputs))
        if self.layers and (len(self.layers) < 2 or (self.layers[0], self.layers[-1]) != ends):
            sizes = f"{ends[0]} inputs first and {ends[1]} gains last, or none for constant gains"
            raise ContractError(f"layers are {list(self.layers)}, expected {sizes}")
        if not all(type(size) is int and size > 0 for size in self.layers):
            raise ContractError(f"layers are {list(self.layers)}, expected whole numbers > 0")
        if tuple(o.name for o in self.outputs) != Gains._fields:
            raise ContractError(
                f"outputs are {[o.name for o in self.outputs]}, expected {list(Gains._fields)}"
            )
        if self.activation != "relu":
            raise ContractError(f"activation is {self.activation!r}, expected 'relu'")
        for i in self.inputs:
            if not (math.isfinite(i.scale) and i.scale > 0.0 and math.isfinite(i.offset)):
                raise ContractError(
                    f"input {i.name} has scale {i.scale!r} and offset {i.offset!r}, expected scale > 0"
                )
        for o in self.outputs:
            if not (math.isfinite(o.low) and math.isfinite(o.high) and o.low <= o.high):
                raise ContractError(
                    f"output {o.name} has range [{o.low!r}, {o.high!r}], expected low <= high"
                )
        for name in ("control_period", "lookahead"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0.0):
                raise ContractError(f"{name} is {value!r}, expected a positive number")

    def differences(
        self, control_period: float, lookahead: float, robot_hash: str = ""
    ) -> list[str]:
        """What does not fit a controller of this period [s], lookahead [m] and robot (empty: any)."""
        found = []
        names, given = [i.name for i in self.inputs], [i.name for i in INPUTS]
        if names != given:
            found.append(f"inputs are {names}, this controller gives {given}")
        for name, theirs, ours in (
            ("control period", self.control_period, control_period),
            ("lookahead", self.lookahead, lookahead),
        ):
            if not math.isclose(theirs, ours, rel_tol=1e-3):
                found.append(f"{name} is {theirs:g}, this controller runs at {ours:g}")
        if robot_hash and self.robot_hash and robot_hash != self.robot_hash:
            found.append(f"robot hash is {self.robot_hash}, this robot's is {robot_hash}")
        return found

    def to_json(self) -> dict[str, Any]:
        """Plain types."""
        return {"format": FORMAT, "format_version": FORMAT_VERSION, **asdict(self)}

    @classmethod
    def from_json(cls, data: object) -> PolicySpec:
        """Inverse of `to_json`; unknown and missing fields are errors."""
        if not isinstance(data, Mapping):
            raise ContractError(f"contract is a {type(data).__name__}, expected an object")
        data = dict(data)
        came, version = data.pop("format", None), data.pop("format_version", None)
        if came != FORMAT or version != FORMAT_VERSION:
            raise ContractError(
                f"format is {came!r} version {version!r}, expected {FORMAT!r} version {FORMAT_VERSION}"
            )
        values = _checked_fields(cls, data, "contract")
        values["layers"] = tuple(values["layers"])
        values["inputs"] = tuple(_build(Input, i, "input") for i in values["inputs"])
        values["outputs"] = tuple(_build(Output, o, "output") for o in values["outputs"])
        values["limits"] = _build(ControlLimits, values["limits"], "limits")
        values["guidance"] = _build(GuidanceConfig, values["guidance"], "guidance")
        contract: PolicySpec = _construct(cls, values, "contract")
        return contract


def _build(kind: type, data: object, where: str) -> Any:
    if not isinstance(data, Mapping):
        raise ContractError(f"{where} is {data!r}, expected an object")
    return _construct(kind, _checked_fields(kind, data, where), where)


def _construct(kind: type, values: dict[str, Any], where: str) -> Any:
    try:
        return kind(**values)
    except ContractError:
        raise
    except (TypeError, ValueError, OverflowError) as error:
        raise ContractError(f"{where}: {error}") from error


def _checked_fields(kind: type, data: Mapping[str, Any], where: str) -> dict[str, Any]:
    known = {f.name for f in fields(kind)}
    missing, unknown = sorted(known - set(data)), sorted(set(data) - known)
    if missing or unknown:
        parts = [f"lacks {', '.join(missing)}"] * bool(missing) + [
            f"has unknown {', '.join(unknown)}"
        ] * bool(unknown)
        raise ContractError(f"{where} {' and '.join(parts)}")
    for f in fields(kind):
        kinds, expected = _KINDS.get(str(f.type), ((), "an object"))
        if kinds and type(data[f.name]) not in kinds:
            raise ContractError(f"{where}: {f.name} is {data[f.name]!r}, expected {expected}")
    return dict(data)
