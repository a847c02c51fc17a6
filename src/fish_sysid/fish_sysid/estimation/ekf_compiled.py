# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The filter's pass in C, one trial per call, several trials on several threads."""

from __future__ import annotations

import ctypes
import functools
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from importlib.resources import files

import numpy as np

from fish_report.parallel import on_all_cores
from fish_sim.compiled import Check, lanes, library
from fish_sim.kernel_source import filter_source
from fish_sim.model import DT
from fish_sim.robot import Structure
from fish_sim.step import Stepper
from fish_sysid.estimation.ekf_check import SENSORS, filter_errors
from fish_sysid.estimation.ekf_numpy import Filter
from fish_sysid.estimation.ekf_types import (
    ENCODER_ROW,
    ROWS,
    WRENCH,
    Array,
    FilterResult,
    History,
    Noise,
    Problem,
    SensorModel,
    encoder_terms,
    first_commands,
    first_state,
    follow_commands,
    place_frames,
)

ROTOR = 1  # of the memory: its speed


class Settings(ctypes.Structure):
    """`Settings` of c/ekf.c."""

    _fields_ = [
        *((name, ctypes.c_double) for name in SENSORS),
        *((f"slope_{name}", ctypes.c_double) for name in SENSORS),
        *((f"free_{name}", ctypes.c_long) for name in SENSORS),
        ("wrench_at", ctypes.c_long * 3),
        ("substeps", ctypes.c_long),
        ("wrench_decay", ctypes.c_double),
        ("wrench_variance", ctypes.c_double * 3),
        *(
            (name, ctypes.c_double)
            for name in ("gyro", "accel", "position", "heading", "gate_imu", "gate_camera")
        ),
    ]


def settings(stepper: Stepper, sensors: SensorModel, noise: Noise) -> Settings:
    """Numbers for the C code."""
    decay = float(np.exp(-DT / noise.wrench_time))
    variance = np.square(noise.wrench) * (1.0 - decay**2)
    return Settings(
        *(getattr(sensors, name) for name in SENSORS),
        *(sensors.slope.get(name, 1.0) for name in SENSORS),
        *(sensors.free.get(name, -1) for name in SENSORS),
        (ctypes.c_long * 3)(*(stepper.layout.parameters.index(name) for name in WRENCH)),
        stepper.scheme.substeps,
        decay,
        (ctypes.c_double * 3)(*variance),
        noise.gyro,
        noise.accel,
        noise.camera_position,
        noise.camera_heading,
        noise.gate_imu,
        noise.gate_camera,
    )


@functools.lru_cache(maxsize=128)
def filter_library(structure: Structure, method: str) -> ctypes.CDLL | None:
    """The compiled and checked filter of a structure under an integrator, or None where it is that of NumPy."""
    width = lanes()
    source, check = filter_text(structure, method, width), filter_check(structure, method, width)
    # the loops over matrices take 1.6 times as long with -Og
    return library(source, check, width, derivatives=True, quick="-O1")


def filter_text(structure: Structure, method: str, width: int) -> str:
    """Complete C text of the filter."""
    own = (files("fish_sysid.estimation") / "c" / "ekf.c").read_text()
    return filter_source(structure, method, width) + own


def filter_check(structure: Structure, method: str, width: int) -> Check:
    """What compares a library of `filter_text` with the filter in NumPy."""
    return lambda loaded: filter_errors(structure, method, width, partial(_passed, loaded))


def _passed(loaded: ctypes.CDLL, numpy_filter: Filter) -> FilterResult:
    """One pass of a library with the problem, the noise and the memory of a filter in NumPy."""
    problem = numpy_filter.problem
    driven = _Driven.of(numpy_filter.memory, numpy_filter.d_memory, True)
    job = _Job(loaded, problem, driven, numpy_filter.noise, True)
    for m in range(len(problem.experiment.names)):
        job.run(m)
    return job.result()


def compiled_passes(
    problem: Problem, noises: Sequence[Noise], keep: bool
) -> list[FilterResult] | None:
    """The result of a pass with each noise, or None when it cannot be compiled here."""
    loaded = filter_library(problem.stepper.layout.structure, problem.stepper.scheme.method)
    if loaded is None:
        return None
    driven = _driven(problem, keep)
    jobs = [_Job(loaded, problem, driven, noise, keep) for noise in noises]
    runs = [partial(job.run, m) for job in jobs for m in range(len(problem.experiment.names))]
    on_all_cores(lambda run: run(), runs)
    return [job.result() for job in jobs]


@dataclass(frozen=True)
class _Driven:
    """What the commands alone decide: of the memory and its derivatives no more than is used."""

    start: Array  # (M, NM)
    d_start: Array  # (M, K, NM)
    rotor: Array  # (T, M) rad/s
    d_rotor: Array  # (T, M, K)
    memory: Array | None  # (T + 1, M, NM) where it is kept

    @classmethod
    def of(cls, memory: Array, d_memory: Array, keep: bool) -> _Driven:
        """Copies of what is used of memory (T + 1, M, NM) and d_memory (T + 1, M, K, NM)."""
        start, d_start = memory[0].copy(), d_memory[0].copy()
        rotor, d_rotor = memory[:-1, ..., ROTOR].copy(), d_memory[:-1, ..., ROTOR].copy()
        return cls(start, d_start, rotor, d_rotor, memory.copy() if keep else None)


def _driven(problem: Problem, keep: bool) -> _Driven:
    """Servo and motor under the commands, one trial at a time: all memories with all derivatives would take gigabytes.

    Without several free parameters all trials at once: a single row is not computed to the last bit as one among others.
    """
    before, commands = first_commands(problem.experiment), problem.experiment.commands
    trials = [slice(m, m + 1) for m in range(len(before))] if len(problem.dp) > 1 else [slice(None)]
    parts = [
        _Driven.of(*follow_commands(problem, before[some], commands[:, some]), keep)
        for some in trials
    ]
    memory = [part.memory for part in parts if part.memory is not None]
    return _Driven(
        np.concatenate([part.start for part in parts]),
        np.concatenate([part.d_start for part in parts]),
        np.concatenate([part.rotor for part in parts], axis=1),
        np.concatenate([part.d_rotor for part in parts], axis=1),
        np.concatenate(memory, axis=1) if keep else None,
    )


class _Job:
    """Arrays of one pass, C order, one block per trial."""

    def __init__(
        self, loaded: ctypes.CDLL, problem: Problem, driven: _Driven, noise: Noise, keep: bool
    ) -> None:
        experiment, stepper, sensors = problem.experiment, problem.stepper, problem.sensors
        self.loaded, self.experiment, self.noise, self.driven = loaded, experiment, noise, driven
        self.settings = settings(stepper, sensors, noise)
        layout, T, M, K = stepper.layout, experiment.length, len(experiment.names), len(problem.dp)
        self.n, self.K = len(layout.motion) + 6, K
        self.p, self.dp = (
            np.ascontiguousarray(problem.p, float),
            np.ascontiguousarray(problem.dp, float),
        )
        self.commands = _per_trial(experiment.commands)
        self.imu = _per_trial(
            np.concatenate([experiment.gyro[..., None], experiment.accel], axis=2)
        )
        offset, pose = place_frames(experiment, sensors)
        self.offset, self.pose = _per_trial(offset), _per_trial(pose)
        self.start, self.start_P = first_state(experiment, layout, sensors, noise)
        self.sums, self.gradient, self.normal = (
            np.zeros((M, 2)),
            np.zeros((M, K)),
            np.zeros((M, K, K)),
        )
        self.whitened = np.full((M, T, 6), np.nan)
        row = 3 * self.n**2 + 2 * self.n + len(layout.memory)
        self.history = np.zeros((M, T, row)) if keep else None

    def run(self, m: int) -> None:
        """Filter trial m."""
        arrays = (self.commands, self.imu, self.offset, self.pose)
        results = (self.sums, self.gradient, self.normal, self.whitened)
        history = None if self.history is None else _at(self.history[m])
        failed = self.loaded.filter_trial(
            ctypes.c_long(int(self.experiment.steps[m])),
            ctypes.c_long(self.K),
            *(_at(a[m]) for a in arrays),
            _at(self.p),
            _at(self.dp),
            ctypes.byref(self.settings),
            _at(self.start[m]),
            _at(self.start_P[m]),
            _at(self.driven.start[m]),
            _at(self.driven.d_start[m]),
            *(_at(a[m]) for a in results),
            history,
        )
        if failed:
            raise MemoryError(f"no memory for the derivatives along {self.K} free parameters")

    def result(self) -> FilterResult:
        """Sums of all trials, the encoder's among them."""
        T, M, driven = self.experiment.length, len(self.experiment.names), self.driven
        normal = self.normal + np.tril(self.normal, -1).transpose(0, 2, 1)
        terms = encoder_terms(self.experiment, self.noise, driven.rotor, driven.d_rotor)
        whitened = np.full((T, M, len(ROWS) + 1), np.nan)
        whitened[..., :6] = self.whitened.transpose(1, 0, 2)
        whitened[..., ENCODER_ROW] = terms.whitened
        return FilterResult(
            self.sums[:, 0] + terms.log_likelihood,
            self.sums[:, 1] + terms.samples,
            self.gradient + terms.gradient,
            normal + terms.normal,
            whitened,
            None if self.history is None else self._history(self.history),
        )

    def _history(self, rows: Array) -> History:
        assert self.driven.memory is not None
        n, h = self.n, rows.transpose(1, 0, 2)
        T, M = h.shape[:2]
        cuts = np.cumsum([n, n * n, n, n * n, n * n])
        parts = np.split(h, cuts, axis=2)[:5]
        shaped = [a.reshape(T, M, n, n) if a.shape[2] == n * n else a for a in parts]
        return History(shaped[0], shaped[1], shaped[2], shaped[3], shaped[4], self.driven.memory)


def _per_trial(array: Array) -> Array:
    return np.ascontiguousarray(np.swapaxes(array, 0, 1), dtype=float)


def _at(array: Array) -> ctypes.c_void_p:
    return ctypes.c_void_p(array.ctypes.data)
