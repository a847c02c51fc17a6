"""Reading rate: 100 made-up trials of 20 s into typed data sets, against rosbags' raw reading of the same files.

    python src/fish_train/benchmarks/read_recordings.py [--trials 100] [--recordings FOLDER]

Raw reading is rosbags' AnyReader opened on a trial and run through all its messages, undecoded. Asked: at least half
of its rate, and 100 trials of 20 s in under 20 s on two cores.
"""

from __future__ import annotations

import argparse
import os
import shutil
import sys
import tempfile
from pathlib import Path
from time import perf_counter

from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

from fish_train.recordings import find_trials, read_dataset

sys.path.insert(0, str(Path(__file__).parents[1] / "test"))
from recording_samples import robot_messages, write_mcap  # noqa: E402

TOPICS = ("joint_command", "joint_states", "imu/data", "camera/pose", "battery_state")


def make_trials(folder: Path, count: int) -> None:
    """One trial of 20 s as in the identification recordings, and copies of it."""
    messages = [m for m in robot_messages(20.0) if m[1].removeprefix("/fish/") in TOPICS]
    first = write_mcap(folder / "trial_000", messages)
    for i in range(1, count):
        shutil.copytree(first, folder / f"trial_{i:03d}")


def raw_rate(folder: Path) -> float:
    """Messages per second of rosbags, one process."""
    store, count, start = get_typestore(Stores.ROS2_JAZZY), 0, perf_counter()
    for path in find_trials(folder):
        with AnyReader([path], default_typestore=store) as reader:
            count += sum(1 for _ in reader.messages())
    return count / (perf_counter() - start)


def typed_rate(folder: Path, processes: int) -> tuple[float, float]:
    """Messages per second and seconds of read_dataset."""
    start = perf_counter()
    data = read_dataset(folder, processes=processes)
    seconds = perf_counter() - start
    return sum(topic.count for trial in data for topic in trial.topics) / seconds, seconds


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--trials", type=int, default=100)
    parser.add_argument("--recordings", type=Path, help="read this data set instead of made-up trials")
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        folder = args.recordings or Path(temporary)
        if args.recordings is None:
            make_trials(folder, args.trials)
        raw_rate(folder)  # files into memory
        raw = raw_rate(folder)
        print(f"rosbags raw, 1 process: {raw:10,.0f} messages/s")
        for processes in (1, min(2, len(os.sched_getaffinity(0)))):
            rate, seconds = typed_rate(folder, processes)
            ratio = rate / raw
            print(
                f"typed, {processes} process(es): {rate:10,.0f} messages/s, {ratio:.2f} of raw, {seconds:.2f} s in all"
            )


if __name__ == "__main__":
    main()
