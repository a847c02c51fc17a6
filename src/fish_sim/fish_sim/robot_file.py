# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""robot.yaml: read and write a robot with units, sources and standard errors.

Every value in a file is checked; an error names file, field, value and what was expected.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import yaml

from fish_report.errors import user_errors
from fish_report.files import read_yaml
from fish_sim.effects import EFFECTS
from fish_sim.parameter import Parameter
from fish_sim.robot import Robot, RobotError, check_links, check_value, nominal_parameters
from fish_sim.sensors import SENSOR_EFFECTS

FORMAT = 1
FIELDS = ("value", "unit", "std", "source")  # of a value; a parameter has `knowledge` as well

STATES = ("filter", "shooting")  # ways to the state that a prediction starts from


def load_robot(path: str | Path) -> Robot:
    """Read robot.yaml (or a model.yaml written by the diagnosis). Raises RobotError with file and field."""
    path = Path(path)
    try:
        return _from_content(read_yaml(path))
    except ValueError as error:
        raise RobotError(f"{path}: {error}") from error


def read_model(path: Path | None) -> Robot:
    """The robot that a command is given as a robot.yaml or model.yaml; None: the nominal robot.

    Raises:
        UserError: the file is not there or is no robot.
    """
    with user_errors():
        return Robot() if path is None else load_robot(path)


def _from_content(content: Any) -> Robot:
    if not isinstance(content, dict):
        raise RobotError(
            f"got {type(content).__name__}; expected a table with format, links, parameters"
        )
    known = {"format", "name", "links", "parameters", "effects", "sensors", "prediction", "notes"}
    if unknown := sorted(map(str, set(content) - known)):
        raise RobotError(f"{unknown[0]}: unknown field; known: {', '.join(sorted(known))}")
    if content.get("format") != FORMAT:
        raise RobotError(f"format: got {content.get('format')!r}; expected {FORMAT}")
    links, name = content.get("links", 3), content.get("name", "fish")
    check_links(links)
    if not isinstance(name, str | int | float):
        raise RobotError(f"name: got {name!r}; expected a word")
    return Robot(
        links=links,
        parameters=_values(
            "parameters",
            content.get("parameters") or {},
            nominal_parameters(links),
            (*FIELDS, "knowledge"),
        ),
        effects=_effect_values("effects", content.get("effects") or {}, EFFECTS),
        sensors=_effect_values("sensors", content.get("sensors") or {}, SENSOR_EFFECTS),
        name=str(name),
        prediction=_check_prediction(content.get("prediction") or {}),
        knowledge={
            name: entry["knowledge"]
            for name, entry in (content.get("parameters") or {}).items()
            if isinstance(entry, dict) and "knowledge" in entry
        },
    )


def _check_prediction(given: Any) -> dict[str, Any]:
    """{states: shooting or filter, noise and trust: {name: number, ..}}; what the numbers mean is up to the estimator."""
    if not isinstance(given, dict):
        raise RobotError(f"prediction: got {given!r}; expected a table with states, noise, trust")
    for name in given:
        if name not in ("states", "noise", "trust"):
            raise RobotError(f"prediction.{name}: unknown field; known: states, noise, trust")
    if given.get("states", STATES[0]) not in STATES:
        raise RobotError(
            f"prediction.states: got {given['states']!r}; expected one of {', '.join(STATES)}"
        )
    for name in ("noise", "trust"):
        if not isinstance(given.get(name, {}), dict):
            raise RobotError(
                f"prediction.{name}: got {given[name]!r}; expected a table of name: number"
            )
    return dict(given)


def _effect_values(where: str, given: Any, table: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """Parameter values of every effect in a file; unknown names are left to Robot to refuse."""
    if not isinstance(given, dict):
        raise RobotError(f"{where}: got {given!r}; expected a table of effect: parameters")
    found = {}
    for name, values in given.items():
        known = table[name].parameters if name in table else {}
        if known and (values is None or values == {}):
            raise RobotError(
                f"{where}.{name}: got no parameter; expected at least one of {', '.join(known)}; "
                f"give one, or leave {name} out"
            )
        found[name] = _values(f"{where}.{name}", {} if values is None else values, known)
    return found


def _values(
    where: str, table: Any, units: Mapping[str, Parameter], fields: Sequence[str] = FIELDS
) -> dict[str, Any]:
    """Entries are plain numbers or tables of `fields`; a unit, where given, must be the model's."""
    if not isinstance(table, dict):
        raise RobotError(f"{where}: got {table!r}; expected a table of name: value")
    result = {}
    for name, entry in table.items():
        if isinstance(entry, dict):
            if unknown := sorted(map(str, set(entry) - set(fields))):
                raise RobotError(
                    f"{where}.{name}.{unknown[0]}: unknown field; known: {', '.join(fields)}"
                )
            if "value" not in entry:
                raise RobotError(
                    f"{where}.{name}: got {entry!r}; expected a number or a table with 'value'"
                )
            if name in units and entry.get("unit", units[name].unit) != units[name].unit:
                raise RobotError(
                    f"{where}.{name}.unit: got {entry['unit']!r}; expected {units[name].unit!r}"
                )
            if not _unknown(entry.get("std")):
                unit = units[name].unit if name in units else ""
                check_value(
                    f"{where}.{name}.std", Parameter(0.0, unit, 0.0, math.inf), entry["std"]
                )
            entry = entry["value"]
        result[name] = entry
    return result


def _unknown(std: Any) -> bool:
    """Whether nothing is known of a standard error, as in a file that states none."""
    return std is None or (isinstance(std, float) and not math.isfinite(std) and std != -math.inf)


def save_robot(
    robot: Robot, path: str | Path, std: Mapping[str, float] | None = None, notes: str = ""
) -> None:
    """Write robot.yaml with units and sources; `std` maps `name` or `effect.name` to a standard error.

    One that is not finite is left out: nothing is known of it.
    """
    std = std or {}

    def rows(
        values: Mapping[str, float], specification: Mapping[str, Parameter], prefix: str = ""
    ) -> dict[str, Any]:
        table = {}
        for name, value in values.items():
            parameter = specification[name]
            row: dict[str, Any] = {"value": float(value), "unit": parameter.unit}
            if math.isfinite(std.get(prefix + name, math.nan)):
                row["std"] = float(std[prefix + name])
            if not prefix and name in robot.knowledge:
                row["knowledge"] = robot.knowledge[name]
            row["source"] = (
                parameter.source if value == parameter.value else "identified or set by the user"
            )
            table[name] = row
        return table

    content: dict[str, Any] = {"format": FORMAT, "name": robot.name, "links": robot.links}
    content["parameters"] = rows(robot.parameters, nominal_parameters(robot.links))
    for key, table in (("effects", EFFECTS), ("sensors", SENSOR_EFFECTS)):
        enabled = getattr(robot, key)
        content[key] = {
            name: rows(v, table[name].parameters, f"{name}.") for name, v in enabled.items()
        }
    if robot.prediction:
        content["prediction"] = dict(robot.prediction)
    if notes:
        content["notes"] = notes
    Path(path).write_text(yaml.safe_dump(content, sort_keys=False, width=110))
