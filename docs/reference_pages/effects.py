# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The page of the effects: what the nominal model may lack, with equation and parameters."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from fish_sim.effects import EFFECTS
from fish_sim.sensors import SENSOR_EFFECTS
from reference_pages import HEADER, bounds, cell, escaped, number, table

INTRODUCTION = """# Effects

An effect is what the nominal model leaves out. `diagnose` looks for every effect of this page but `disturbance`; the
simulator and the training take them from `robot.yaml`:

```yaml
effects:
  current:
    x: {value: 0.03, unit: m/s}
```

With the neutral value the robot is the nominal one. The typical value is a plausible strength, from which searches start.
[Add an effect of your own](../how_to/add_an_effect.md).
"""


def page() -> str:
    """Effects on the fish, then the sensors' errors."""
    count = f"{len(EFFECTS) - 1} effects on fish, water and actuators, {len(SENSOR_EFFECTS)} errors of sensors"
    links = ((f"[`{name}`](#{name})", cell(e.equation)) for name, e in every())
    body = [section(name, effect) for name, effect in every()]
    return "\n".join(
        [HEADER, INTRODUCTION, f"{count}.\n", table(("name", "equation"), links), *body]
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
