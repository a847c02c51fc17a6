# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The page of robot.yaml: the nominal parameters with unit, range and source."""

from __future__ import annotations

from fish_sim.robot import nominal_parameters
from reference_pages import HEADER, bounds, cell, number, table

INTRODUCTION = """# The robot file

`robot.yaml` holds a robot's parameters; a parameter that is left out keeps its nominal value. `identify` writes
one with standard errors, `diagnose` writes `model.yaml` in the same format with the effects that it found. The installed
file `fish_sim/config/robot.yaml` is the nominal fish. [The fish and its parameters](../explanation/the_fish.md) shows
what each of them measures.

```yaml
format: 1
parameters:
  head_mass: {value: 0.465, unit: kg}
```

The values below are those of the default of three tail links. The order is that of the parameter vector in Python.
"""


def page() -> str:
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
    return "\n".join([HEADER, INTRODUCTION, table(head, rows)])
