# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The compiled kernel: NumPy arrays in, NumPy arrays out, through ctypes (which releases the interpreter lock)."""

from __future__ import annotations

import ctypes
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Part = Literal["values", "tangents", "adjoints", "memory"]  # what is compiled by itself


class CompiledKernel:
    """Calls the C text of the same name, whichever part was compiled; arrays C-contiguous float64, layouts as there."""

    def __init__(self, library: ctypes.CDLL) -> None:
        self._library = library

    def rollout(self, states: Array, commands: Array, parameters: Array) -> None:
        """Fill states[1:] from states[0]."""
        self._library.rollout(
            *_sizes(states), _at(states), *_shared(commands, 1), *_shared(parameters, 0)
        )

    def rollout_jvp(
        self,
        states: Array,
        tangents: Array,
        commands: Array,
        d_commands: Array,
        parameters: Array,
        d_parameters: Array,
    ) -> None:
        """Fill states[1:] and tangents[1:]."""
        self._library.rollout_jvp(
            *_sizes(states),
            _at(states),
            _at(tangents),
            *_shared(commands, 1),
            *_shared(d_commands, 1),
            *_shared(parameters, 0),
            *_shared(d_parameters, 0),
        )

    def rollout_vjp(
        self,
        states: Array,
        commands: Array,
        parameters: Array,
        g_states: Array,
        g_start: Array,
        g_commands: Array,
        g_parameters: Array,
    ) -> None:
        """Fill g_start, g_commands and g_parameters."""
        self._library.rollout_vjp(
            *_sizes(states),
            _at(states),
            *_shared(commands, 1),
            *_shared(parameters, 0),
            *(_at(a) for a in (g_states, g_start, g_commands, g_parameters)),
        )

    def rates_jvp(
        self,
        x: Array,
        dx: Array,
        w: Array,
        dw: Array,
        parameters: Array,
        d_parameters: Array,
        out: Array,
        d_out: Array,
    ) -> None:
        """Fill out and d_out (batch, NX) with rates of motion and their tangents."""
        self._library.rates_jvp(
            ctypes.c_long(len(x)),
            *(_at(a) for a in (x, dx, w, dw)),
            *_shared(parameters, 0),
            *_shared(d_parameters, 0),
            _at(out),
            _at(d_out),
        )

    def memory_jvp(
        self,
        memory: Array,
        tangents: Array,
        commands: Array,
        parameters: Array,
        d_parameters: Array,
    ) -> None:
        """Fill memory[1:] and tangents[1:] (T + 1, batch, NM)."""
        self._library.memory_jvp(
            *_sizes(memory),
            _at(memory),
            _at(tangents),
            *_shared(commands, 1),
            *_shared(parameters, 0),
            *_shared(d_parameters, 0),
        )


def _at(array: Array) -> ctypes.c_void_p:
    return ctypes.c_void_p(array.ctypes.data)


def _sizes(states: Array) -> tuple[ctypes.c_long, ctypes.c_long]:
    return ctypes.c_long(states.shape[1]), ctypes.c_long(states.shape[0] - 1)


def _shared(array: Array, axis: int) -> tuple[ctypes.c_void_p, ctypes.c_long]:
    return _at(array), ctypes.c_long(array.shape[axis])
