# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""A robot: number of tail links, parameter values and the effects that are switched on.

Names, units and nominal values are those of the model description; every value is checked, and an error names field,
value and what was expected.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from fish_sim.effects import EFFECTS
from fish_sim.effects.effect import Effect
from fish_sim.parameter import Parameter
from fish_sim.sensors import SENSOR_EFFECTS

# number of tail links, and the enabled effects in the order in which they act
Structure = tuple[int, tuple[type[Effect], ...]]

# kg/m, slender body strip rho pi/4 h^2, height h = 0.075 m
STRIP_ADDED_MASS = 1000.0 * math.pi / 4.0 * 0.075**2
KNOWLEDGE = (
    "measured",
    "estimated",
    "unknown",
)  # of a parameter: within 5 %, tens of per cent, a factor of three
MAX_LINKS = 12  # beyond this the fastest tail mode needs steps far below 1 ms


class RobotError(ValueError):
    """A robot description that cannot be used; the message names field, value and expectation."""


def nominal_parameters(links: int = 3) -> dict[str, Parameter]:
    """The nominal fish with `links` equal tail links, in the order of the kernels' parameter vector.

    Published are the lengths of head (150 mm) and tail (100 mm), the total mass (535 g) and the speeds. How lengths and masses
    are divided, and all coefficients, are assumptions; with them the fish swims at the published 0.1 to 0.5 m/s.
    """
    check_links(links)
    n = links
    divided = "assumption, adds up to the published lengths and mass; use scales and a ruler"
    assumed = "assumption; reproduces 0.1 to 0.5 m/s"
    strip = "slender-body strip, rho pi/4 h^2 per length, h = 0.075 m"
    rod = "1 is a uniform rod: inertia = factor (mass + added mass) length^2 / 12; a real tail's is spread unevenly"

    def p(
        value: float, unit: str, source: str, lowest: float = 0.0, highest: float = math.inf
    ) -> Parameter:
        return Parameter(value=value, unit=unit, lowest=lowest, highest=highest, source=source)

    return {
        "head_mass": p(0.465, "kg", divided, 1e-6),
        "head_added_mass_surge": p(0.05, "kg", assumed),
        "head_added_mass_sway": p(0.55, "kg", assumed),
        "head_inertia": p(2.4e-3, "kg m^2", assumed + "; includes the added inertia", 1e-9),
        "hinge_offset": p(0.075, "m", divided),
        "link_length": p(0.07 / n, "m", divided, 1e-6),
        "link_mass": p(0.05 / n, "kg", divided, 1e-9),
        "link_added_mass_sway": p(STRIP_ADDED_MASS * 0.07 / n, "kg", strip),
        "link_inertia_factor": p(1.0, "1", rod),
        "fin_length": p(0.03, "m", divided, 1e-6),
        "fin_mass": p(0.02, "kg", divided, 1e-9),
        "fin_added_mass_sway": p(STRIP_ADDED_MASS * 0.03, "kg", strip),
        "fin_inertia_factor": p(1.0, "1", rod),
        "tail_stiffness": p(0.10 * n / 3, "N m/rad", assumed),
        "rotor_inertia": p(1.0e-4, "kg m^2", assumed),
        "head_drag_surge": p(0.20, "N s/m", assumed),
        "head_drag_sway": p(1.5, "N s/m", assumed),
        "head_drag_yaw": p(3.0e-3, "N m s/rad", assumed),
        "link_drag_surge": p(0.06 / n, "N s/m", assumed),
        "link_drag_sway": p(0.9 / n, "N s/m", assumed),
        "fin_drag_surge": p(0.03, "N s/m", assumed),
        "fin_drag_sway": p(0.4, "N s/m", assumed),
        "servo_rate_limit": p(6.0, "rad/s", "assumption; hobby servo under load", 1e-3),
        "rudder_range": p(0.8, "rad", "assumption; use a protractor", 1e-3, math.pi / 2),
    }


def check_links(links: int) -> None:
    if isinstance(links, bool) or not isinstance(links, int) or not 1 <= links <= MAX_LINKS:
        raise RobotError(f"links: got {links!r}; expected a whole number from 1 to {MAX_LINKS}")


@dataclass(frozen=True)
class Robot:
    """A fish: number of tail links, parameter values and enabled effects with their parameter values."""

    links: int = 3
    parameters: Mapping[str, float] = field(
        default_factory=dict
    )  # missing names take the nominal value
    effects: Mapping[str, Mapping[str, float]] = field(
        default_factory=dict
    )  # EFFECTS name -> parameter -> value
    sensors: Mapping[str, Mapping[str, float]] = field(
        default_factory=dict
    )  # SENSOR_EFFECTS name -> ...
    name: str = "fish"
    table: Mapping[str, type[Effect]] = field(
        default_factory=lambda: EFFECTS, repr=False, compare=False
    )  # effects that it may have, by name, in the order in which they act
    knowledge: Mapping[str, str] = field(
        default_factory=dict
    )  # parameter -> one of KNOWLEDGE: how wide the prior of a fit is
    prediction: Mapping[str, Any] = field(
        default_factory=dict
    )  # how its states are best estimated, as identification found it; changes no motion

    def __post_init__(self) -> None:
        nominal = nominal_parameters(self.links)
        values = _check_table("parameters", nominal, self.parameters)
        object.__setattr__(self, "parameters", values)
        _check_knowledge(self.knowledge, nominal)
        object.__setattr__(self, "effects", _check_effects("effects", self.table, self.effects))
        object.__setattr__(self, "sensors", _check_effects("sensors", SENSOR_EFFECTS, self.sensors))

    @property
    def structure(self) -> Structure:
        """What decides the compiled kernel: number of links and the enabled effects, in table order."""
        return self.links, tuple(kind for name, kind in self.table.items() if name in self.effects)

    def vector(self) -> list[float]:
        """All parameter values in the order of `parameter_names(self.structure)`."""
        enabled = (values for name in self.table if (values := self.effects.get(name)) is not None)
        return [*self.parameters.values(), *(v for values in enabled for v in values.values())]

    def with_parameters(self, **values: float) -> Robot:
        """The same robot with some parameters changed."""
        return replace(self, parameters={**self.parameters, **values})

    def with_effect(self, name: str, **values: float) -> Robot:
        """The same robot with one more effect (or other values for one it has)."""
        if name in SENSOR_EFFECTS:
            return replace(self, sensors={**self.sensors, name: values})
        return replace(self, effects={**self.effects, name: values})

    def without_effect(self, name: str) -> Robot:
        """The same robot less one effect or sensor error; itself where it has none of that name."""
        effects, sensors = (
            {key: values for key, values in table.items() if key != name}
            for table in (self.effects, self.sensors)
        )
        return replace(self, effects=effects, sensors=sensors)

    def digest(self) -> str:
        """Hash of everything that changes its motion; weights files carry it."""
        content = {
            "links": self.links,
            "parameters": dict(self.parameters),
            "effects": self.effects,
        }
        return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()[:16]


def parameter_names(structure: Structure) -> tuple[str, ...]:
    """Names in a kernel's parameter vector: robot parameters, then `effect.parameter`."""
    links, effects = structure
    own = [f"{effect.name}.{key}" for effect in effects for key in effect.parameters]
    return (*nominal_parameters(links), *own)


def _check_knowledge(given: Mapping[str, Any], specification: Mapping[str, Parameter]) -> None:
    for name, word in given.items():
        if name not in specification:
            raise RobotError(f"knowledge.{name}: unknown name; known: {', '.join(specification)}")
        if word not in KNOWLEDGE:
            raise RobotError(
                f"parameters.{name}.knowledge: got {word!r}; expected one of {', '.join(KNOWLEDGE)}"
            )


def _check_table(
    where: str, specification: Mapping[str, Parameter], given: Mapping[str, Any]
) -> dict[str, float]:
    if not isinstance(given, Mapping):
        raise RobotError(f"{where}: got {given!r}; expected a table of name: value")
    for name in given:
        if name not in specification:
            raise RobotError(f"{where}.{name}: unknown name; known: {', '.join(specification)}")
    return {
        name: check_value(f"{where}.{name}", parameter, given.get(name, parameter.value))
        for name, parameter in specification.items()
    }


def check_value(where: str, parameter: Parameter, value: Any) -> float:
    expected = f"a number in [{parameter.lowest:g}, {parameter.highest:g}] {parameter.unit}"
    if isinstance(value, str):
        expected += " (YAML reads 1e-3 as text: write 1.0e-3)"
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise RobotError(f"{where}: got {value!r}; expected {expected}")
    try:
        number = float(value)
    except OverflowError:  # YAML's whole numbers have no end; nobody wants to read this one
        raise RobotError(
            f"{where}: got a whole number beyond every float; expected {expected}"
        ) from None
    if not math.isfinite(number) or not parameter.lowest <= number <= parameter.highest:
        raise RobotError(f"{where}: got {value!r} {parameter.unit}; expected {expected}")
    return number


def _check_effects(
    where: str, table: Mapping[str, Any], given: Mapping[str, Any]
) -> dict[str, dict[str, float]]:
    for name in given:
        if name not in table:
            raise RobotError(f"{where}: unknown effect {name!r}; known: {', '.join(table)}")
    return {
        name: _check_table(f"{where}.{name}", table[name].parameters, given[name] or {})
        for name in table
        if name in given
    }
