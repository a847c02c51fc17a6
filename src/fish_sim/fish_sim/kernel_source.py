# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""C text of a kernel: the sizes and the tableau, the emitted expressions, and the loops of c/ around them."""

from __future__ import annotations

from importlib.resources import files

from fish_sim.compiled import has_libmvec
from fish_sim.emit import emit
from fish_sim.kernel import Part
from fish_sim.methods import METHODS, Method
from fish_sim.model import COMMAND_NAMES, DRIVE_NAMES, DT, Layout, functions
from fish_sim.robot import Structure
from fish_sim.scheme import Scheme

# what each part of a kernel consists of: functions of `model.Functions`, then texts in c/; compiled when first asked for
PARTS: dict[Part, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "values": (("rate", "follow"), ("step.c", "rows.c", "rollout.c")),
    "tangents": (
        ("rate", "rate_jvp", "follow", "follow_jvp"),
        ("step.c", "tangent.c", "rows.c", "rollout_jvp.c"),
    ),
    "adjoints": (
        ("rate", "rate_vjp", "follow", "follow_vjp"),
        ("step.c", "adjoint.c", "rows.c", "rollout_vjp.c"),
    ),
    "memory": (
        ("follow_jvp",),
        ("rows.c", "memory_jvp.c"),
    ),  # built in a tenth of the time of the tangents
}


def kernel_source(structure: Structure, scheme: Scheme, width: int, part: Part) -> str:
    """Complete C text of one part of a structure's kernel."""
    return _source(structure, scheme.method, str(scheme.substeps), width, *PARTS[part])


def filter_source(structure: Structure, method: str, width: int) -> str:
    """C text of the step and of rates with their slopes, exporting nothing; filters build on it.

    Every thread sets `substeps`, the integrator's steps in a period, before it steps: one text serves every robot.
    """
    names = ("rate", "rate_and_vjp", "follow", "follow_jvp")
    return "static _Thread_local int substeps;\n" + _source(
        structure, method, "substeps", width, names, ("step.c",)
    )


def _source(
    structure: Structure,
    method: str,
    substeps: str,
    width: int,
    names: tuple[str, ...],
    texts: tuple[str, ...],
) -> str:
    folder, table = files("fish_sim") / "c", functions(structure)
    return "\n".join(
        [
            *_definitions(Layout(structure), METHODS[method], substeps, width),
            (folder / "vector.h").read_text(),
            *(emit(getattr(table, name)) for name in names),
            *((folder / text).read_text() for text in texts),
        ]
    )


def _definitions(layout: Layout, method: Method, substeps: str, width: int) -> list[str]:
    """Sizes and the tableau as C text."""
    sizes = {
        "LANES": width,
        "NQ": layout.links + 3,
        "NX": len(layout.motion),
        "NM": len(layout.memory),
        "NS": len(layout.state),
        "NP": len(layout.parameters),
        "NC": len(COMMAND_NAMES),
        "NW": len(DRIVE_NAMES),
        "STAGES": len(method.B),
        "SUBSTEPS": substeps,
        "DT": repr(DT),
    }
    if has_libmvec():
        sizes["LIBMVEC"] = 1
    lines = [f"#define {name} {value}" for name, value in sizes.items()]
    rows = ["{" + ", ".join(map(repr, row)) + "}" for row in method.A]
    lines.append("static const double A[STAGES][STAGES] = {" + ", ".join(rows) + "};")
    vectors = ((k, ", ".join(map(repr, getattr(method, k)))) for k in "BC")
    return [*lines, *(f"static const double {k}[STAGES] = {{{values}}};" for k, values in vectors)]
