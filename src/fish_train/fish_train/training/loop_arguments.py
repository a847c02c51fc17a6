# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Arguments of the compiled closed loop as C structures; fields as in c/closed_loop.c."""

from __future__ import annotations

import ctypes

MAX_LAYERS = 8
POINTER = ctypes.c_void_p


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
