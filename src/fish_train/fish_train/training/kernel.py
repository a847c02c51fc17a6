# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What the compiled kernel of the closed loop is made from: the equations as CasADi functions with adjoints, C structures."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from functools import lru_cache

import casadi

from fish_sim.ops import CASADI
from fish_train.training.closed_loop_equations import (
    COST_NAMES,
    PHYSICS_STEPS,
    SIZES,
    Law,
    act,
    drive,
    motion,
    sense,
)

SENSE_OUTPUTS = ("inputs", "errors", "guidance", "report", "cost")
ACT_OUTPUTS = ("control", "last", "cost")
MAX_LAYERS = 8
POINTER = ctypes.c_void_p


@lru_cache(maxsize=8)
def expressions(law: Law) -> tuple[casadi.Function, ...]:
    """sense, act, drive and motion, each followed by its adjoint `NAME_vjp(inputs.., g) -> adjoints`.

    sense(seen, true, guidance, setpoint, geometry_seen, geometry_true, speed, weights): adjoints of the first four;
    act(errors, control, last, raw, weights): of the first four; drive(actuator, setpoint): of both;
    motion(q3, qd3): of both. Outputs are stacked in the order of SENSE_OUTPUTS, ACT_OUTPUTS, (actuator, command).
    """
    return (*_sense(law), *_act(law), *_drive(law), *_motion())


def _sense(law: Law) -> tuple[casadi.Function, casadi.Function]:
    motions, geometry = SIZES["motion"], SIZES["geometry"]
    sizes = [
        PHYSICS_STEPS * motions,
        motions,
        SIZES["guidance"],
        SIZES["setpoint"],
        geometry,
        geometry,
        1,
        len(COST_NAMES),
    ]
    arguments = _symbols(sizes)
    seen, true, guidance, setpoint, near, real, speed, weights = map(casadi.vertsplit, arguments)
    values = sense(seen, true, guidance, setpoint, near, real, speed[0], weights, law, CASADI)
    return _with_adjoint(
        "sense", arguments, [v for k in SENSE_OUTPUTS for v in values[k]], (0, 1, 2, 3)
    )


def _act(law: Law) -> tuple[casadi.Function, casadi.Function]:
    arguments = _symbols(
        [*(SIZES[k] for k in ("errors", "control", "last", "gains")), len(COST_NAMES)]
    )
    errors, control, last, raw, weights = map(casadi.vertsplit, arguments)
    values = act(errors, control, last, raw, weights, law, CASADI)
    return _with_adjoint(
        "act", arguments, [v for k in ACT_OUTPUTS for v in values[k]], (0, 1, 2, 3)
    )


def _drive(law: Law) -> tuple[casadi.Function, casadi.Function]:
    arguments = _symbols([SIZES["actuator"], 2])
    moving, setpoint = map(casadi.vertsplit, arguments)
    actuator, command = drive(moving, setpoint, law, CASADI)
    return _with_adjoint("drive", arguments, [*actuator, *command], (0, 1))


def _motion() -> tuple[casadi.Function, casadi.Function]:
    arguments = _symbols([3, 3])
    q, qd = map(casadi.vertsplit, arguments)
    return _with_adjoint("motion", arguments, motion(q, qd, CASADI), (0, 1))


def _symbols(sizes: Sequence[int]) -> list[casadi.SX]:
    return [casadi.SX.sym(f"a{k}", size) for k, size in enumerate(sizes)]


def _with_adjoint(
    name: str, arguments: list[casadi.SX], outputs: list[casadi.SX], wrt: tuple[int, ...]
) -> tuple[casadi.Function, casadi.Function]:
    """(function, adjoint of the arguments numbered in `wrt`)."""
    value = casadi.vertcat(*outputs)
    chosen = [arguments[k] for k in wrt]
    g = casadi.SX.sym("g", value.shape[0])
    reverse = casadi.jtimes(value, casadi.vertcat(*chosen), g, True)
    cuts = [0]
    for argument in chosen:
        cuts.append(cuts[-1] + argument.shape[0])
    return (
        casadi.Function(name, arguments, casadi.cse([value])),
        casadi.Function(
            f"{name}_vjp", [*arguments, g], casadi.cse(casadi.vertsplit(reverse, cuts))
        ),
    )


class NetworkArguments(ctypes.Structure):
    """Layers of the network: sizes and arrays of each."""

    _fields_ = [
        ("layers", ctypes.c_long),
        ("columns", ctypes.c_long),
        ("size", ctypes.c_long * (MAX_LAYERS + 1)),
        *(
            (name, POINTER * MAX_LAYERS)
            for name in ("panels", "transposed", "activation", "adjoint", "bias")
        ),
    ]


class WindowArguments(ctypes.Structure):
    """One window: batch, steps, and every array of the closed loop."""

    _fields_ = [
        *((name, ctypes.c_long) for name in ("batch", "steps", "hold", "gradient")),
        *(
            (name, POINTER)
            for name in (
                "p",
                "speed",
                "cost",
                "noise",
                "delay",
                "path",
                "plant",
                "memory",
                "place",
                "history",
                "report",
                "gains",
                "value",
            )
        ),
    ]


class PathArguments(ctypes.Structure):
    """Points of a path and how it ends."""

    _fields_ = [
        ("table", POINTER),
        ("spacing", ctypes.c_double),
        ("lap_end", ctypes.c_double),
        ("count", ctypes.c_long),
        ("last", ctypes.c_long),
        ("closed", ctypes.c_int),
        ("restarts", ctypes.c_int),
    ]


class SearchArguments(ctypes.Structure):
    """How the place on a path is searched."""

    _fields_ = [
        (k, ctypes.c_double)
        for k in ("search_window", "lookahead", "lookahead_search", "capture_distance")
    ]
