# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Starts and ends nodes as processes: own process group each, output to a log file, CPU time from /proc."""

from __future__ import annotations

import contextlib
import ctypes
import os
import signal
import subprocess
import time
from collections.abc import Iterable, Mapping
from pathlib import Path
from types import TracebackType
from typing import Self

from fish_bringup.node_table import (
    NAMESPACE,
    NodeSpec,
    Parameters,
    command,
    environment,
)

GRACE = ((signal.SIGINT, 8.0), (signal.SIGTERM, 4.0), (signal.SIGKILL, 4.0))  # s to wait after each
PR_SET_PDEATHSIG = 1  # linux/prctl.h
CLOCK_TICKS = os.sysconf("SC_CLK_TCK")
_prctl = ctypes.CDLL(None).prctl  # resolved here: a forked child must not


class NodeProcess:
    """One running node."""

    def __init__(
        self,
        spec: NodeSpec,
        parameters: Parameters | Mapping[NodeSpec, Parameters] | None,
        env: dict[str, str],
        log_folder: Path,
        namespace: str = NAMESPACE,
    ) -> None:
        self.spec = spec
        self.log = log_folder / f"{spec.package}.{spec.executable}.log"
        with self.log.open("ab") as log:
            self._popen = subprocess.Popen(
                command(spec, parameters, namespace),
                env=env,
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=subprocess.STDOUT,
                start_new_session=True,
                preexec_fn=_die_with_parent,
            )

    @property
    def pid(self) -> int:
        """Process id; also the id of its group."""
        return self._popen.pid

    @property
    def status(self) -> int | None:
        """Exit status, None while it runs."""
        return self._popen.poll()

    def cpu_time(self) -> float:
        """User and system time of the running process, all threads [s]; 0 once it has ended."""
        try:
            fields = Path(f"/proc/{self.pid}/stat").read_text().rpartition(")")[2].split()
        except FileNotFoundError:
            return 0.0
        return (int(fields[11]) + int(fields[12])) / CLOCK_TICKS

    def signal(self, number: signal.Signals) -> None:
        """Send a signal to the process group, if it is still there."""
        if self.status is None:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(self.pid, number)

    def wait(self, timeout_s: float) -> int | None:
        """Exit status once it has ended, None if it has not within the time."""
        try:
            return self._popen.wait(timeout_s)
        except subprocess.TimeoutExpired:
            return None

    def last_words(self) -> str:
        """Last line of its log that says something."""
        lines = [
            line.strip()
            for line in self.log.read_text(errors="replace").splitlines()
            if line.strip()
        ]
        return lines[-1] if lines else "(it said nothing)"


class NodeProcesses:
    """A set of nodes that is ended as a whole; a context manager, so that nothing is left behind."""

    def __init__(self, domain: int, log_folder: Path, namespace: str = NAMESPACE) -> None:
        log_folder.mkdir(parents=True, exist_ok=True)
        self.environment = environment(domain)
        self._log_folder, self._namespace = log_folder, namespace
        self.running: dict[NodeSpec, NodeProcess] = {}

    def start(
        self, spec: NodeSpec, parameters: Parameters | Mapping[NodeSpec, Parameters] | None = None
    ) -> NodeProcess:
        """Start a process, or start it again after its end; parameters as for `command`."""
        process = NodeProcess(spec, parameters, self.environment, self._log_folder, self._namespace)
        self.running[spec] = process
        return process

    def ended(self) -> list[NodeProcess]:
        """The nodes that are no longer running."""
        return [process for process in self.running.values() if process.status is not None]

    def cpu_times(self) -> dict[NodeSpec, float]:
        """CPU time of every node so far [s]."""
        return {spec: process.cpu_time() for spec, process in self.running.items()}

    def stop(self, specs: Iterable[NodeSpec] | None = None) -> dict[NodeSpec, int | None]:
        """End nodes (all, if not said otherwise): SIGINT, then SIGTERM, then SIGKILL; their exit status."""
        chosen = [self.running[spec] for spec in (self.running if specs is None else specs)]
        for number, grace_s in GRACE:
            for process in chosen:
                process.signal(number)
            deadline = time.monotonic() + grace_s
            if all(
                process.wait(max(deadline - time.monotonic(), 0.0)) is not None
                for process in chosen
            ):
                break
        return {process.spec: process.status for process in chosen}

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.stop()


def _die_with_parent() -> None:
    """In the child before it starts: SIGTERM when the parent dies, kill -9 of the starter leaves no node."""
    signal.signal(
        signal.SIGINT, signal.SIG_DFL
    )  # a shell's background job ignores it, and children inherit that
    _prctl(PR_SET_PDEATHSIG, signal.SIGTERM)
