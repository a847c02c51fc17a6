# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The pages of the robot file and of the effects: nominal parameters, and what the nominal model may lack."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from fish_sim.effects import EFFECTS
from fish_sim.robot import nominal_parameters
from fish_sim.sensors import SENSOR_EFFECTS
from reference_pages import HEADER, bounds, cell, escaped, number, table

EFFECTS_PAGE = """# Effects

An effect is what the nominal model leaves out. `diagnose` looks for every effect of this page but
`disturbance` and `camera_marker`, and for `imu_latency` with `--baseline` alone. Simulator and training take effects from
`robot.yaml`:

```yaml
effects:
  current:
    x: {value: 0.03, unit: m/s}
```

With the neutral value the robot is the nominal one. The typical value is a plausible strength, from which searches start.
[Add an effect of your own](../how_to/add_an_effect.md).
"""


def effects_page() -> str:
    """Effects on the fish, then the sensors' errors."""
    count = f"{len(EFFECTS)} effects on fish, water and actuators, {len(SENSOR_EFFECTS)} errors of sensors"
    links = ((f"[`{name}`](#{name})", cell(e.equation)) for name, e in every())
    body = [section(name, effect) for name, effect in every()]
    return "\n".join(
        [HEADER, EFFECTS_PAGE, f"{count}.\n", table(("name", "equation"), links), *body]
    )


def every() -> list[tuple[str, Any]]:
    """(name, class) of all."""
    return [*EFFECTS.items(), *SENSOR_EFFECTS.items()]


def section(name: str, effect: Any) -> str:
    """One effect."""
    summary = " ".join((effect.__doc__ or "").partition("\n\n")[0].split())
    facts = [f"Kind: {effect.kind}.", f"Source: {effect.source}."]
    if states := getattr(effect, "states", ()):
        facts.append(f"States of its own: {', '.join(f'`{s}`' for s in states)}.")
    if getattr(effect, "dissipative", False):
        facts.append("It never adds energy in still water.")
    equation = f"```text\n{effect.equation}\n```"
    return (
        f"## {name}\n\n{escaped(summary)}\n\n{equation}\n\n{parameter_table(effect.parameters)}\n"
        f"{escaped(' '.join(facts))}\n"
    )


def parameter_table(parameters: Mapping[str, Any]) -> str:
    """Of one effect; of a series such as the gyres of a flow the first eight rows stand for all."""
    rows = [
        (
            f"`{name}`",
            cell(p.unit or "1"),
            number(p.value),
            bounds(p.lowest, p.highest),
            "" if p.typical is None else number(p.typical),
        )
        for name, p in parameters.items()
    ]
    head = ("parameter", "unit", "neutral", "range", "typical")
    if len(rows) <= 8:
        return table(head, rows)
    return table(head, rows[:8]) + f"\nand {len(rows) - 8} more up to {rows[-1][0]}, alike.\n"


ROBOT_FILE = """# The robot file

`robot.yaml` holds a robot's parameters; a parameter that is left out keeps its nominal value. `identify` writes
one with standard errors, `diagnose` writes `model.yaml` in the same format with the effects that it found. The installed
file `fish_sim/config/robot.yaml` is the nominal fish. [The fish and its parameters](../explanation/the_fish.md) shows
what each of them measures.

```yaml
format: 1
parameters:
  head_mass: {value: 0.465, unit: kg}
```

| key | what it holds |
|---|---|
| `format` | 1 |
| `name`, `notes` | text; `diagnose` writes its verdict into `notes` |
| `links` | number of tail links, 3 where it is left out |
| `parameters` | see below; a number, or a table with `value`, `unit`, `std`, `source`, `knowledge` |
| `effects`, `sensors` | physics and sensor errors beyond the nominal model ([effects](effects.md)) |
| `prediction` | noise and way of a robot that is fitted to predictions; `identify` writes it |

Nominal values of a link are for the given number of links; those below are for three. The order is that of the parameter
vector in Python.
"""


def robot_page() -> str:
    """The nominal parameters."""
    rows = (
        (
            f"`{name}`",
            number(p.value),
            cell(p.unit or "1"),
            bounds(p.lowest, p.highest),
            cell(p.source),
        )
        for name, p in nominal_parameters().items()
    )
    head = ("parameter", "nominal", "unit", "range", "source")
    return "\n".join([HEADER, ROBOT_FILE, table(head, rows)])
