"""Where the fit of an effect starts: a small strength with its other parameters at plausible values."""

from __future__ import annotations

from fish_sim.effects import EFFECTS
from fish_sim.sensors import SENSOR_EFFECTS
from fish_train.identify.hypothesis import specification


def start_values(name: str, fraction: float) -> dict[str, float]:
    """Values with every strength parameter at `fraction` of the way from neutral to typical."""
    strength = {**EFFECTS, **SENSOR_EFFECTS}[name].strength
    values = {}
    for key, parameter in specification(name).items():
        typical = parameter.value if parameter.typical is None else parameter.typical
        values[key] = parameter.value + fraction * (typical - parameter.value) if key in strength else typical
    return values
