"""Which names count as right for a world: its own, or for another form or engine those that mean the same physics."""

from __future__ import annotations

from fish_study.other_forms import MEANS
from fish_study.scenario import World


def truths_of(world: World) -> tuple[str, ...] | None:
    """Names of the vocabulary; None: the hidden effects' own names."""
    if world.plant != "mujoco":
        other = set(world.names) & set(MEANS)
        return tuple(MEANS.get(name, name) for name in world.names) if other else None
    from fish_study.mujoco_effects import CONCEALED

    return tuple(name for hidden in world.names for name in CONCEALED[hidden].names)
