# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Draw the fish from above, with the lengths of Robot(): python docs/images/the_fish.py [FILE]."""

from __future__ import annotations

import itertools
import math
import sys
from pathlib import Path

from fish_sim.robot import Robot

SCALE = 2400.0  # drawing units for a metre
ORIGIN = (520.0, 150.0)  # where the head's centre of mass is drawn
HEAD_LENGTH, HEAD_WIDTH = 0.150, 0.070  # m; the length is published, the width only drawn
RUDDER = 0.35  # rad, joint 1 bends by -RUDDER: the fish steers left
STYLE = """
<style>
text { font: 13px sans-serif; fill: #222 }
.axis { stroke: #c00; stroke-width: 1.6; fill: none }
.red { fill: #c00 }
.body { fill: #e4eef6; stroke: #246; stroke-width: 1.6 }
.link { stroke: #246; stroke-width: 7; stroke-linecap: round }
.fin { stroke: #2a7; stroke-width: 4; stroke-linecap: round }
.rotor { fill: none; stroke: #b60; stroke-width: 2 }
.size { stroke: #777; stroke-width: 1 }
.joint { fill: #fff; stroke: #246; stroke-width: 1.4 }
</style>"""

Point = tuple[float, float]


def at(x: float, y: float) -> Point:
    """A point of base_link [m] on the page: y points left of the fish, so up on the page."""
    return ORIGIN[0] + SCALE * x, ORIGIN[1] - SCALE * y


def line(a: Point, b: Point, kind: str) -> str:
    """A straight line between two points of the page."""
    return f'<line class="{kind}" x1="{a[0]:.1f}" y1="{a[1]:.1f}" x2="{b[0]:.1f}" y2="{b[1]:.1f}"/>'


def text(place: Point, words: str, anchor: str = "middle", kind: str = "") -> str:
    """Words at a point of the page."""
    return f'<text class="{kind}" x="{place[0]:.1f}" y="{place[1]:.1f}" text-anchor="{anchor}">{words}</text>'


def arrow(a: Point, b: Point) -> str:
    """A line with a head at b."""
    angle = math.atan2(b[1] - a[1], b[0] - a[0])
    corners = [b] + [
        (b[0] - 10 * math.cos(angle + side), b[1] - 10 * math.sin(angle + side))
        for side in (0.35, -0.35)
    ]
    head = " ".join(f"{x:.1f},{y:.1f}" for x, y in corners)
    return line(a, b, "axis") + f'<polygon class="red" points="{head}"/>'


def size(a: Point, b: Point, drop: float, words: str) -> list[str]:
    """A horizontal dimension line from the x of a to the x of b, at the height `drop` of the page."""
    ends = [line((x, drop - 5), (x, drop + 5), "size") for x, _ in (a, b)]
    middle = (0.5 * (a[0] + b[0]), drop - 5)
    return [*ends, line((a[0], drop), (b[0], drop), "size"), text(middle, words)]


def tail(robot: Robot) -> list[Point]:
    """Hinge, joints, root and tip of the fin [m, base_link], with the rudder at RUDDER and the springs at rest."""
    values = robot.parameters
    angle, points = -RUDDER, [(-values["hinge_offset"], 0.0)]
    for length in [values["link_length"]] * robot.links + [values["fin_length"]]:
        x, y = points[-1]
        points.append((x - length * math.cos(angle), y - length * math.sin(angle)))
    return points


def drawing(robot: Robot) -> str:
    """The whole picture."""
    values = robot.parameters
    bent = tail(robot)
    joints, tip = [at(*p) for p in bent], at(*bent[-1])
    nose, hinge, centre = at(HEAD_LENGTH / 2, 0.0), joints[0], at(0.0, 0.0)
    straight_end = at(-values["hinge_offset"] - robot.links * values["link_length"], 0.0)
    straight_tip = (straight_end[0] - SCALE * values["fin_length"], straight_end[1])
    arc = at(-values["hinge_offset"] - 70 / SCALE * math.cos(RUDDER), 70 / SCALE * math.sin(RUDDER))
    radii = SCALE * HEAD_LENGTH / 2, SCALE * HEAD_WIDTH / 2
    body = [
        f'<ellipse class="body" cx="{centre[0]}" cy="{centre[1]}" rx="{radii[0]}" ry="{radii[1]}"/>',
        f'<circle class="rotor" cx="{centre[0]}" cy="{centre[1]}" r="52"/>',
        text((centre[0], centre[1] + 70), "rotor φ"),
        *(line(a, b, "link") for a, b in itertools.pairwise(joints[:-1])),
        line(joints[-2], tip, "fin"),
        *(f'<circle class="joint" cx="{x:.1f}" cy="{y:.1f}" r="4.5"/>' for x, y in joints[:-2]),
    ]
    axes = [
        arrow(centre, at(0.055, 0.0)),
        arrow(centre, at(0.0, 0.030)),
        text((at(0.055, 0.0)[0] + 4, centre[1] + 18), "x, forward (surge u)", "end", "red"),
        text((centre[0] + 8, at(0.0, 0.030)[1] + 6), "y, left (sway v)", "start", "red"),
        f'<path class="axis" d="M {centre[0] + 30},{centre[1]} A 30 30 0 0 0 {centre[0]},{centre[1] - 30}"/>',
        text((centre[0] - 34, centre[1] + 5), "yaw r", "middle", "red"),
    ]
    labels = [
        line(hinge, straight_tip, "size"),
        text((hinge[0] - 6, hinge[1] + 20), "hinge", "end"),
        text((tip[0] - 14, tip[1] - 12), "tip p: no sideways slip", "start"),
        text((joints[-2][0] - 34, joints[-2][1] + 12), "fin", "start"),
        text((joints[2][0] + 14, joints[2][1] - 18), f"{robot.links} links with springs", "start"),
        f'<path class="size" fill="none" d="M {hinge[0] - 70},{hinge[1]} A 70 70 0 0 1 {arc[0]:.1f},{arc[1]:.1f}"/>',
        text((hinge[0] - 78, hinge[1] - 8), "α", "end"),
        text((straight_tip[0], straight_tip[1] + 20), "α above 0 steers left", "start"),
        text((380.0, 24.0), "the fish from above, rudder at α = 0.35 rad, lengths in mm"),
    ]
    link_end = (hinge[0] - SCALE * robot.links * values["link_length"], 0.0)
    sizes = [
        *size(at(-HEAD_LENGTH / 2, 0), nose, 270, f"head {1000 * HEAD_LENGTH:.0f}"),
        *size(hinge, centre, 295, f"hinge_offset {1000 * values['hinge_offset']:.0f}"),
        *size(
            link_end, hinge, 270, f"{robot.links} × link_length {1000 * values['link_length']:.1f}"
        ),
        *size(straight_tip, link_end, 295, f"fin_length {1000 * values['fin_length']:.0f}"),
    ]
    content = "\n".join([STYLE, *body, *axes, *labels, *sizes])
    return f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 740 315" width="740" height="315">{content}\n</svg>\n'


if __name__ == "__main__":
    out = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).with_suffix(".svg")
    out.write_text(drawing(Robot()))
