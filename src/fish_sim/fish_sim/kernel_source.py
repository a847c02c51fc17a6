# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""C text of a kernel: the sizes and the tableau, the emitted expressions, and the loops of c/ around them.

Every variable of an emitted expression is a SIMD vector: one lane per batch element. CasADi's own C generator emits scalar
code; emitting the same instruction list over `V` (a GCC vector type, or a plain double) lets one core advance 4 or 8 fish
at once.
"""

from __future__ import annotations

from importlib.resources import files

import casadi

from fish_sim.compiled import has_libmvec
from fish_sim.kernel import Part
from fish_sim.methods import METHODS, Method
from fish_sim.model import COMMAND_NAMES, DRIVE_NAMES, DT, Layout, functions
from fish_sim.robot import Structure
from fish_sim.scheme import Scheme

BINARY = {casadi.OP_ADD: "+", casadi.OP_SUB: "-", casadi.OP_MUL: "*", casadi.OP_DIV: "/"}
UNARY_FORM = {
    casadi.OP_ASSIGN: "{0}",
    casadi.OP_NEG: "-{0}",
    casadi.OP_SQ: "{0} * {0}",
    casadi.OP_TWICE: "{0} + {0}",
    casadi.OP_INV: "1.0 / {0}",
}
# functions defined in c/vector.h for both kinds of V
CALL = {
    casadi.OP_SIN: "v_sin",
    casadi.OP_COS: "v_cos",
    casadi.OP_EXP: "v_exp",
    casadi.OP_LOG: "v_log",
    casadi.OP_TANH: "v_tanh",
    casadi.OP_SQRT: "v_sqrt",
    casadi.OP_FABS: "v_fabs",
    casadi.OP_SIGN: "v_sign",
    casadi.OP_FLOOR: "v_floor",
    casadi.OP_NOT: "v_not",
    casadi.OP_ATAN2: "v_atan2",
    casadi.OP_FMIN: "v_fmin",
    casadi.OP_FMAX: "v_fmax",
    casadi.OP_POW: "v_pow",
    casadi.OP_CONSTPOW: "v_pow",
    casadi.OP_LT: "v_lt",
    casadi.OP_LE: "v_le",
    casadi.OP_EQ: "v_eq",
    casadi.OP_NE: "v_ne",
    casadi.OP_AND: "v_and",
    casadi.OP_OR: "v_or",
    casadi.OP_IF_ELSE_ZERO: "v_if_else_zero",
}


def emit(function: casadi.Function) -> str:
    """C text of `static void name(const V *i0, .., V *o0, ..)` for a CasADi SX function with dense arguments."""
    inputs, outputs = range(function.n_in()), range(function.n_out())
    arguments = [
        *(f"const V *restrict i{k}" for k in inputs),
        *(f"V *restrict o{k}" for k in outputs),
    ]
    registers = [f"  V w{k};" for k in range(function.sz_w())]
    body = [f"  {_instruction(function, k)}" for k in range(function.n_instructions())]
    head = f"static void {function.name()}({', '.join(arguments)})"
    return "\n".join([head, "{", *registers, *_zero_outputs(function), *body, "}", ""])


def _zero_outputs(function: casadi.Function) -> list[str]:
    """Structurally zero entries of an output are never assigned by an instruction."""
    lines = []
    for k in range(function.n_out()):
        sparsity = function.sparsity_out(k)
        if sparsity.nnz() != sparsity.numel():
            lines.append(
                f"  for (int j = 0; j < {sparsity.numel()}; ++j) o{k}[j] = v_constant(0.0);"
            )
    return lines


def _instruction(function: casadi.Function, k: int) -> str:
    operation = function.instruction_id(k)
    # registers; of inputs and outputs the argument and its nonzero
    out, arguments = function.instruction_output(k), function.instruction_input(k)
    if operation == casadi.OP_CONST:
        return f"w{out[0]} = v_constant({function.instruction_constant(k)!r});"
    if operation == casadi.OP_INPUT:
        return f"w{out[0]} = i{arguments[0]}[{_row(function.sparsity_in(arguments[0]), arguments[1])}];"
    if operation == casadi.OP_OUTPUT:
        return f"o{out[0]}[{_row(function.sparsity_out(out[0]), out[1])}] = w{arguments[0]};"
    names = [f"w{a}" for a in arguments]
    if operation in BINARY:
        return f"w{out[0]} = {names[0]} {BINARY[operation]} {names[1]};"
    if operation in UNARY_FORM:
        return f"w{out[0]} = {UNARY_FORM[operation].format(*names)};"
    if operation in CALL:
        return f"w{out[0]} = {CALL[operation]}({', '.join(names)});"
    raise NotImplementedError(
        f"{function.name()}: CasADi operation {operation} has no C form; add it to emit.CALL"
    )


def _row(sparsity: casadi.Sparsity, nonzero: int) -> int:
    return int(sparsity.row()[nonzero])


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
