# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""CasADi expression -> C source whose every variable is a SIMD vector: one lane per batch element.

CasADi's own C generator emits scalar code; emitting the same instruction list over `V` (a GCC vector type, or a plain
double) lets one core advance 4 or 8 fish at once.
"""

from __future__ import annotations

import casadi

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
