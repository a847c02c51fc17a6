# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Make each scenario's recordings, run the tool on them as a process of its own, keep what it answers.

The tool's process gets the folder of recordings and an output folder, whose names tell nothing.
"""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, as_completed
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fish_report.files import write_json
from fish_report.parallel import at_end_of_worker, worker_pool
from fish_study.build import make_recordings
from fish_study.pair_recordings import NEW, OLD, make_pair
from fish_study.scenario import Scenario, ScenarioError
from fish_study.study import Study, StudyError, read_json
from fish_study.tool_version import checked_version

DIAGNOSE = (sys.executable, "-m", "fish_report.robofish", "diagnose")
LONGEST = 3600.0  # s, one diagnosis
STOPPED = (130, -signal.SIGINT, -signal.SIGTERM)  # exit status of a tool that somebody stopped
TAIL = 2000  # characters kept of what a failed tool said

Done = Callable[[str], None]


@dataclass(frozen=True)
class Job:
    """One scenario to be run."""

    name: str
    scenario: Scenario
    folder: Path
    tool: tuple[str, ...] = DIAGNOSE
    keep: bool = False  # the recordings
    threads: int = 1  # of the tool
    version: str = ""  # of the tool that the study examines; "": any


def run_scenario(job: Job) -> str:
    """Make, diagnose, write result.json; returns the scenario's name. A tool that fails is a result too."""
    recordings, out = job.folder / "recordings", job.folder / "tool"
    for left in (recordings, out):  # of a run that was killed
        shutil.rmtree(left, ignore_errors=True)
    job.folder.mkdir(parents=True, exist_ok=True)
    began = time.monotonic()
    error = ""
    at_wall: dict[str, float] = {}
    try:
        make = make_pair if job.scenario.pair else make_recordings
        at_wall = make(job.scenario, recordings)
    except ScenarioError as problem:  # would happen again
        error = f"no scenario: {problem}"
    version = checked_version(job.version, job.name)
    answer: dict[str, Any] = {"diagnosis": None, "error": error}
    if not error:
        began = time.monotonic()
        answer = _run_tool(job, recordings, out)
    seconds = time.monotonic() - began
    if not job.keep:
        shutil.rmtree(recordings, ignore_errors=True)
    write_json(
        job.folder / "result.json",
        {"seconds": seconds, "tool": version, "ended_at_wall": at_wall, **answer},
    )
    return job.name


_TOOLS: list[subprocess.Popen[str]] = []  # that this worker waits for


def _run_tool(job: Job, recordings: Path, out: Path) -> dict[str, Any]:
    environment = {
        **os.environ,
        **dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), str(job.threads)),
    }
    given = [str(recordings)]
    if job.scenario.pair:
        given = [str(recordings / NEW), "--baseline", str(recordings / OLD)]
    command = [*job.tool, *given, "--out", str(out)]
    with subprocess.Popen(
        command, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
    ) as tool:
        _TOOLS.append(tool)
        try:
            said = tool.communicate(timeout=LONGEST)[1]
        except subprocess.TimeoutExpired:
            return {"diagnosis": None, "error": f"no answer within {LONGEST:g} s"}
        finally:
            tool.kill()
            _TOOLS.remove(tool)
    if tool.returncode in STOPPED:
        raise StudyError(f"{job.name}: the tool was stopped; the same command goes on")
    if tool.returncode != 0:
        return {"diagnosis": None, "error": f"exit status {tool.returncode}: {said[-TAIL:]}"}
    return {"diagnosis": read_json(out / "diagnosis.json"), "error": ""}


def _tools_end_with_the_worker() -> None:
    def kill() -> None:
        for tool in _TOOLS:
            tool.kill()

    at_end_of_worker(kill)


def run_study(
    study: Study,
    jobs: int,
    done: Done,
    tool: Sequence[str] = DIAGNOSE,
    keep: bool = False,
    cluster: str = "",
) -> None:
    """Run every scenario without a result; `done` hears each name. cluster: address of a Dask scheduler."""
    threads = max(1, len(os.sched_getaffinity(0)) // max(jobs, 1))
    scenarios, version = study.scenarios, study.about.get("tool", "")
    tasks = [
        Job(n, scenarios[n], study.folder_of(n).resolve(), tuple(tool), keep, threads, version)
        for n in study.pending
    ]
    for name in spread(run_scenario, tasks, jobs, cluster):
        done(name)


def spread(
    work: Callable[[Any], Any], tasks: Sequence[Any], jobs: int, cluster: str = ""
) -> Iterator[Any]:
    """Results of work(task) as they come, from local processes or a Dask cluster with a shared file system."""
    if cluster:
        from dask.distributed import Client
        from dask.distributed import as_completed as completed

        with Client(cluster) as client:
            for future in completed(client.map(work, tasks, pure=False)):
                yield future.result()
        return
    with worker_pool(jobs, _tools_end_with_the_worker) as pool:
        futures: list[Future[Any]] = [pool.submit(work, task) for task in tasks]
        for future in as_completed(futures):
            yield future.result()
