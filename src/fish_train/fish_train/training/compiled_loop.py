# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The closed loop as one compiled kernel (c/closed_loop.c): a window and the gradient of its cost in the weights."""

from __future__ import annotations

import ctypes
import itertools
from importlib.resources import files

import numpy as np
from numpy.typing import NDArray

from fish_control.path_batch import LOOKAHEAD_SEARCH
from fish_sim.compiled import Check, lanes, library
from fish_sim.kernel_source import emit, kernel_source
from fish_sim.step import Stepper
from fish_train.training.batch import (
    HISTORY,
    BatchState,
    PathBank,
    WindowResult,
    check_hold,
)
from fish_train.training.closed_loop_equations import (
    COST_NAMES,
    INPUT_COUNTS,
    PHYSICS_STEPS,
    SIZES,
    Law,
)
from fish_train.training.kernel import (
    MAX_LAYERS,
    POINTER,
    NetworkArguments,
    PathArguments,
    SearchArguments,
    WindowArguments,
    expressions,
)
from fish_train.training.network import LAYERS, split, weight_count
from fish_train.training.torch_loop import TorchLoop, loop_errors

Array = NDArray[np.float64]
BLOCK = 8


def loop_source(stepper: Stepper, law: Law, width: int) -> str:
    """Complete C text of the kernel for a robot's structure, an integration scheme and a law."""
    names = {
        "NO": "motion",
        "NU": "guidance",
        "NK": "control",
        "NA": "actuator",
        "NL": "last",
        "NE": "errors",
        "NR": "report",
        "NGAIN": "gains",
    }
    sizes = {short: SIZES[name] for short, name in names.items()} | {"NI": INPUT_COUNTS[law.inputs]}
    sizes |= {
        "NQ": stepper.layout.links + 3,
        "PHYSICS": PHYSICS_STEPS,
        "HISTORY": HISTORY,
        "NCOST": len(COST_NAMES),
    }
    c = files("fish_train.training") / "c"
    return "\n".join(
        [
            kernel_source(stepper.layout.structure, stepper.scheme, width, "adjoints"),
            *(f"#define {name} {value}" for name, value in sizes.items()),
            *(emit(function) for function in expressions(law)),
            *((c / name).read_text() for name in ("mlp.h", "path_search.h", "closed_loop.c")),
        ]
    )


def loop_check(stepper: Stepper, law: Law, width: int) -> Check:
    """What compares a library of `loop_source` with the loop in torch."""
    return lambda loaded: loop_errors(
        stepper,
        law,
        width,
        lambda bank, layers: CompiledLoop(stepper, law, bank, layers, width, loaded),
    )


def loop_library(stepper: Stepper, law: Law, width: int) -> ctypes.CDLL | None:
    """The compiled and checked kernel of a loop, or None where it is `TorchLoop`."""
    source, check = loop_source(stepper, law, width), loop_check(stepper, law, width)
    # training takes many steps of one structure: twice as long with -O1
    return library(source, check, width, derivatives=True, quick="-O2")


class CompiledLoop:
    """Windows of the closed loop with one law, one structure of robot, one bank of paths and one network."""

    def __init__(
        self,
        stepper: Stepper,
        law: Law,
        bank: PathBank,
        layers: tuple[int, ...] = LAYERS,
        width: int | None = None,
        loaded: ctypes.CDLL | None = None,
    ) -> None:
        """`loaded` is a library of `loop_source` for this width, by default the one of `loop_library`."""
        self._width = width or lanes()
        loaded = loaded or loop_library(stepper, law, self._width)
        if loaded is None:
            raise RuntimeError(
                "the closed loop could not be compiled here; use fastest_loop or TorchLoop"
            )
        self._library = loaded
        self._library.scratch_size.restype = ctypes.c_long
        if layers[0] != INPUT_COUNTS[law.inputs]:
            raise ValueError(
                f"layers: got {layers}; expected {INPUT_COUNTS[law.inputs]} inputs ({law.inputs})"
            )
        self.layers = layers
        self.set_bank(bank)
        tracker = law.tracker
        self._search = SearchArguments(
            tracker.search_window, tracker.lookahead, LOOKAHEAD_SEARCH, tracker.capture_distance
        )
        self._room: tuple[int, int] | None = None

    @classmethod
    def available(cls) -> bool:
        """Whether a working compiler was found."""
        from fish_sim.compiled import compiler

        return compiler() is not None

    def set_bank(self, bank: PathBank) -> None:
        """Follow other paths from now on."""
        self.bank = bank
        tables = [np.ascontiguousarray(t.rows) for t in bank.tables]
        self._tables = tables  # the kernel holds pointers into them
        self._paths = (PathArguments * len(tables))(
            *(
                PathArguments(
                    rows.ctypes.data,
                    t.spacing,
                    t.lap_end,
                    t.count,
                    len(rows) - 1,
                    t.closed,
                    t.restarts,
                )
                for rows, t in zip(tables, bank.tables, strict=True)
            )
        )

    def window(
        self,
        weights: Array,
        batch_state: BatchState,
        steps: int,
        cost: Array,
        noise: Array | None = None,
        gradient: bool = True,
        hold: int = 1,
    ) -> WindowResult:
        """Run `steps` control periods from this state of the batch, which is advanced in place.

        weights: flat (W,). cost: (6,) weights of the stage cost. noise: (steps + 1, B, 6) added to what is seen.
        hold: periods for which the gains of one policy decision are kept; divides steps.
        """
        check_hold(steps, hold)
        batch = len(batch_state)
        self._make_room(steps, hold)
        weights, cost = np.ascontiguousarray(weights, float), np.ascontiguousarray(cost, float)
        noise = (
            np.zeros((steps + 1, batch, SIZES["motion"]))
            if noise is None
            else np.ascontiguousarray(noise, float)
        )
        report = np.empty((steps + 1, batch, SIZES["report"]))
        applied, value = np.empty((steps, batch, SIZES["last"])), np.empty(batch)
        arrays = (
            batch_state.parameters,
            batch_state.speed,
            cost,
            noise,
            batch_state.delay,
            batch_state.path,
            batch_state.plant,
            batch_state.memory,
            batch_state.place,
            batch_state.history,
            report,
            applied,
            value,
        )
        window = WindowArguments(
            batch, steps, hold, int(gradient), *(a.ctypes.data for a in arrays)
        )
        total = self._run_blocks(window, weights, gradient)
        return WindowResult(float(value.sum() / (batch * steps)), total, report, applied)

    def _run_blocks(self, window: WindowArguments, weights: Array, gradient: bool) -> Array | None:
        """Block after block of `width` fish, whose activations fit the cache; the sum of their weight gradients."""
        network, scratch = ctypes.byref(self._network), POINTER(self._scratch.ctypes.data)
        self._library.repack(network, POINTER(weights.ctypes.data), ctypes.c_long(gradient))
        total = np.zeros(len(weights)) if gradient else None
        for first in range(0, window.batch, self._width):
            self._library.run_block(
                ctypes.byref(window),
                network,
                self._paths,
                ctypes.byref(self._search),
                ctypes.c_long(first),
                scratch,
            )
            if total is not None:
                total += self._weight_gradient()
        return total

    def _weight_gradient(self) -> Array:
        """dJ/dW = G H^T, dJ/db = G 1 over all periods of a block."""
        for (W, b), H, G in zip(
            split(self._block_gradient, self.layers), self._activation, self._adjoint, strict=True
        ):
            np.matmul(G, H.T, out=W)
            np.sum(G, axis=1, out=b)
        return self._block_gradient

    def _make_room(self, steps: int, hold: int) -> None:
        """Activation and adjoint matrices and scratch for windows of this length."""
        if self._room == (steps, hold):
            return
        self._room = (steps, hold)
        layers, columns = self.layers, self._width * steps // hold
        pairs = list(itertools.pairwise(layers))
        self._block_gradient = np.empty(weight_count(layers))
        self._activation = [_aligned(i, columns) for i, _ in pairs]
        self._adjoint = [_aligned(o, columns) for _, o in pairs]
        self._panels = [_aligned(_padded(o), i) for i, o in pairs]
        self._transposed = [_aligned(_padded(i), o) for i, o in pairs]
        network = NetworkArguments(len(pairs), columns, (ctypes.c_long * (MAX_LAYERS + 1))(*layers))
        for name in ("panels", "transposed", "activation", "adjoint"):
            matrices = getattr(self, f"_{name}")
            setattr(network, name, (POINTER * MAX_LAYERS)(*(m.ctypes.data for m in matrices)))
        self._network = network
        size = self._library.scratch_size(
            ctypes.c_long(steps), ctypes.c_long(sum(map(_padded, layers)))
        )
        self._scratch = _aligned(1, size // 8 + 1)


def _padded(size: int) -> int:
    return -(-size // BLOCK) * BLOCK


def _aligned(rows: int, columns: int, boundary: int = 64) -> Array:
    """Zeros (rows, columns) whose first element lies on a cache line, as the kernel's vectors need."""
    raw = np.zeros(rows * columns + boundary // 8)
    offset = -(raw.ctypes.data % boundary) % boundary // 8
    return raw[offset : offset + rows * columns].reshape(rows, columns)


def fastest_loop(
    stepper: Stepper, law: Law, bank: PathBank, layers: tuple[int, ...] = LAYERS
) -> CompiledLoop | TorchLoop:
    """The compiled loop where a compiler makes a right one, else the one of torch."""
    loaded = loop_library(stepper, law, lanes())
    if loaded is None:
        return TorchLoop(stepper, law, bank, layers)
    return CompiledLoop(stepper, law, bank, layers, lanes(), loaded)
