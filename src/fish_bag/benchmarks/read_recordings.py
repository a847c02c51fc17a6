# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Reading rate: 100 made-up trials of 20 s into typed data sets, against rosbags' raw reading of the same files.

    python src/fish_bag/benchmarks/read_recordings.py [--trials 100] [--recordings FOLDER]

Raw reading is rosbags' AnyReader opened on a trial and run through all its messages, undecoded. Asked: at least half
of its rate, and 100 trials of 20 s in under 20 s on two cores.
"""

from __future__ import annotations

import argparse
import os
import shutil
import tempfile
from collections.abc import Callable
from pathlib import Path
from time import perf_counter

from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

from fish_bag import find_trials, read_dataset
from fish_bag.sample_recordings import robot_messages, write_mcap

TOPICS = ("joint_command", "joint_states", "imu/data", "camera/pose", "battery_state")


def make_trials(folder: Path, count: int) -> None:
    """One trial of 20 s as in the identification recordings, and copies of it."""
    messages = [m for m in robot_messages(20.0) if m[1].removeprefix("/fish/") in TOPICS]
    first = write_mcap(folder / "trial_000", messages)
    for i in range(1, count):
        shutil.copytree(first, folder / f"trial_{i:03d}")


def raw_reading(folder: Path) -> int:
    """All messages of all trials through rosbags, undecoded; how many they are."""
    store, count = get_typestore(Stores.ROS2_JAZZY), 0
    for path in find_trials(folder):
        with AnyReader([path], default_typestore=store) as reader:
            count += sum(1 for _ in reader.messages())
    return count


def typed_reading(folder: Path, processes: int) -> int:
    """The same through read_dataset."""
    data = read_dataset(folder, processes=processes)
    return sum(topic.count for trial in data for topic in trial.topics)


def measure(name: str, read: Callable[[], int], reference: float | None = None) -> float:
    """Messages per second of processor time (children's too), which other load on the machine does not change."""
    start, before = perf_counter(), processor_time()
    count = read()
    seconds, busy = perf_counter() - start, processor_time() - before
    ratio = "" if reference is None else f", {count / busy / reference:.2f} of raw"
    print(
        f"{name}: {count / busy:9,.0f} messages per processor second{ratio}; {seconds:.2f} s on the clock"
    )
    return count / busy


def processor_time() -> float:
    used = os.times()
    return used.user + used.system + used.children_user + used.children_system


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--trials", type=int, default=100)
    parser.add_argument(
        "--recordings", type=Path, help="read this data set instead of made-up trials"
    )
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        folder = args.recordings or Path(temporary)
        if args.recordings is None:
            make_trials(folder, args.trials)
        raw_reading(folder)  # files into memory, code into caches
        raw = measure("rosbags raw, 1 process ", lambda: raw_reading(folder))
        measure("typed, 1 process       ", lambda: typed_reading(folder, 1), raw)
        measure("typed, 2 processes     ", lambda: typed_reading(folder, 2), raw)


if __name__ == "__main__":
    main()
