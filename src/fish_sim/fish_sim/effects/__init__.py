"""Missing physics and actuator behaviour, one class per file; the table below is all there is."""

from fish_sim.effects.effect import Effect

EFFECTS: dict[str, type[Effect]] = {}
