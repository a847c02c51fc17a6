# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What the camera sees in the tracker's scenarios: the own fish, rivals that look like it, toys, boards, a mirror image.

A scenario is a function of time [s], of a phase that tells episodes apart, and of random numbers.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import cos, pi, sin

import numpy as np

from fish_node.pool import WIDTH
from fish_sim.camera import FishPose, FishShape, Patch, patches
from fish_vision.pose import wrap

SHAPE = FishShape()
ALONE_S = 0.5  # s until the other fish of the same look comes
DARK, WHITE = (58, 56, 54), (215, 215, 212)
Thing = Sequence[Patch]


@dataclass(frozen=True)
class Scene:
    """What one frame shows: the own fish over the exposure, things below and above it."""

    poses: list[FishPose]
    below: list[Thing]
    above: list[Thing]
    drawn: bool = True  # False: the own fish is not in the pool
    light: tuple[float, float, float] = (1.0, 1.0, 1.0)  # gains of blue, green, red


def swim(t: float, phase: float) -> FishPose:
    """A fish that swims to and fro, its head swinging at 2 Hz."""
    t = t + 40.0 * phase
    course = 0.47 * t + phase
    heading = course + 0.25 * sin(4 * pi * t)
    x, y = 1.6 * sin(0.11 * t + phase), 0.65 * sin(0.23 * t + 2.0 * phase)
    return FishPose(x, y, wrap(heading), tuple(0.2 * sin(9 * t - i) for i in range(3)))


def exposure(t: float, phase: float) -> list[FishPose]:
    """Two poses in an exposure of 4 ms."""
    return [swim(t - 0.001, phase), swim(t + 0.001, phase)]


def rectangle(x: float, y: float, wide: float, high: float, colour: tuple[int, int, int]) -> Thing:
    """A board at rest, middle at x, y, m."""
    a, b = wide / 2, high / 2
    return [
        Patch(np.array([[x - a, y - b], [x + a, y - b], [x + a, y + b], [x - a, y + b]]), colour)
    ]


def disc(x: float, y: float, diameter: float, colour: tuple[int, int, int]) -> Patch:
    """A disc, m."""
    angles = np.linspace(0.0, 2 * pi, 24, endpoint=False)
    return Patch(
        np.array([x, y]) + diameter / 2 * np.column_stack([np.cos(angles), np.sin(angles)]), colour
    )


def clean(t: float, phase: float, _: np.random.Generator) -> Scene:
    """The fish alone."""
    return Scene(exposure(t, phase), [], [])


def warm(t: float, phase: float, _: np.random.Generator) -> Scene:
    """The fish alone under a warm light from the start."""
    return Scene(exposure(t, phase), [], [], light=(0.65, 1.0, 1.25))


def bars_near(t: float, phase: float) -> list[tuple[float, float]]:
    """Middles of those bars that may lie over the fish."""
    own = swim(t, phase)
    return [(0.13 * k, own.y) for k in range(-16, 17) if abs(0.13 * k - own.x) < 0.2]


def bars(t: float, phase: float, _: np.random.Generator) -> Scene:
    """Dark bars of 18 mm across the pool, which hide parts of the markers."""
    return Scene(
        exposure(t, phase),
        [],
        [rectangle(x, y, 0.018, 0.3, DARK) for x, y in bars_near(t, phase)],
    )


def twin(t: float, phase: float, _: np.random.Generator) -> Scene:
    """Another fish of the same look crosses the own one's way every few seconds, at the least distance 0.11 m."""
    own, other = swim(t, phase), swim(t, phase + 1.7)
    s = 0.5 - 0.5 * cos(1.3 * t)  # 1: where they meet
    meeting = FishPose(
        own.x + (1 - s) * (other.x - own.x) + 0.11 * sin(2.1 * t),
        own.y + (1 - s) * (other.y - own.y) + 0.11 * cos(2.1 * t),
        other.heading,
        other.tail,
    )
    return Scene(exposure(t, phase), [patches(meeting, SHAPE)] if t > ALONE_S else [], [])


def hidden(t: float, phase: float, _: np.random.Generator) -> Scene:
    """The own fish goes under a board for 2 s of every 5 s while another of the same look swims in view."""
    own, other = swim(t, phase), swim(t, phase + 1.7)
    board = [rectangle(own.x, own.y, 0.5, 0.5, WHITE)] if (t % 5.0) > 3.0 else []
    return Scene(exposure(t, phase), [patches(other, SHAPE)] if t > ALONE_S else [], board)


def lookalike(t: float, phase: float, _: np.random.Generator) -> Scene:
    """A fish with markers 80 mm apart and none on its tail; ours is in the pool after 5 s only."""
    other = FishShape(front_marker=0.040, rear_marker=-0.040, tail_colours=((62, 62, 62),))
    return Scene(exposure(t, phase), [patches(swim(t, phase + 1.7), other)], [], drawn=t > 5.0)


def toys(t: float, phase: float, random: np.random.Generator) -> Scene:
    """Discs of the markers' colours all over the pool, some about as far apart as the head's; bars over the fish."""
    things: list[Thing] = []
    for _ in range(12):
        x, y, turn = random.uniform([-1.9, -0.9, -pi], [1.9, 0.9, pi])
        gap = random.uniform(0.06, 0.14)
        things.append(
            [
                disc(x, y, 0.05, DARK),
                disc(x, y, random.uniform(0.02, 0.04), SHAPE.front_colour),
                disc(x + gap * cos(turn), y + gap * sin(turn), 0.05, DARK),
                disc(
                    x + gap * cos(turn),
                    y + gap * sin(turn),
                    random.uniform(0.02, 0.04),
                    SHAPE.rear_colour,
                ),
            ]
        )
    own = swim(t, phase)
    board = [rectangle(own.x, own.y, 0.5, 0.5, WHITE)] if (t % 5.0) > 4.0 else []
    return Scene(exposure(t, phase), things, board)


def reflection(t: float, phase: float, _: np.random.Generator) -> Scene:
    """The fish swims along a wall that mirrors it; a board hides it at times, the mirror image stays."""
    poses = [
        FishPose(p.x, WIDTH / 2 - 0.06 + 0.03 * sin(0.9 * t + phase), 0.3 * sin(3 * t), p.tail)
        for p in exposure(t, phase)
    ]
    image = [
        Patch(patch.outline * [1.0, -1.0] + [0.0, WIDTH], tuple(int(0.8 * c) for c in patch.colour))
        for patch in patches(poses[0], SHAPE)
    ]
    own = poses[0]
    above = [rectangle(own.x, own.y - 0.2, 0.5, 0.46, WHITE)] if (t % 4.0) > 3.0 else []
    return Scene(poses, [image], above)


def swapped(t: float, phase: float, _: np.random.Generator) -> Scene:
    """Front and rear marker mistaken for each other; the tail is under water weed."""
    own = swim(t, phase)
    end = np.array([own.x, own.y]) - 0.115 * np.array([cos(own.heading), sin(own.heading)])
    mistaken = replace(SHAPE, front_colour=SHAPE.rear_colour, rear_colour=SHAPE.front_colour)
    fish = [*patches(own, mistaken), disc(end[0], end[1], 0.09, DARK)]
    return Scene([own], [fish], [], drawn=False)


Scenario = Callable[[float, float, np.random.Generator], Scene]
ALONE: dict[str, tuple[Scenario, float]] = {  # name -> scenario, strength of the glare
    "clean": (clean, 0.0),
    "glare": (clean, 1.0),
    "bars": (bars, 0.0),
    "warm": (warm, 0.0),
}
TAGGED: dict[str, tuple[Scenario, float]] = {
    "tags_clean": (clean, 0.0),
    "tags_glare": (clean, 1.0),
    "tags_bars": (bars, 0.0),
    "tags_warm": (warm, 0.0),
    "tags_twin": (twin, 0.0),
}
RIVALS: dict[str, tuple[Scenario, float]] = {
    "twin": (twin, 0.0),
    "hidden": (hidden, 0.0),
    "lookalike": (lookalike, 0.0),
    "toys": (toys, 0.0),
    "reflection": (reflection, 0.0),
    "swapped": (swapped, 0.0),
}
