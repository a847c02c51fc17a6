# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Recovery of recordings with random damage: never an exception, never a message that was not there, none lost without need.

    python src/fish_bag/benchmarks/damage_recordings.py [--damages 10000] [--seed 0]

Every format gets the same number of damages: cuts, tails of zeros, changed bits and bytes, runs of random bytes and of zeros.
In formats without checksums (rosbags' MCAP, sqlite3, ROS 1) a changed byte of a message cannot be seen: there only cuts and
tails are held to "never a message that was not there". Exit status 1 if anything is wrong.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections import Counter
from pathlib import Path

import numpy as np

from fish_bag.damage import KINDS, check, damaged, make_sample
from fish_bag.sample_recordings import WRITERS, robot_messages


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--damages", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=0)
    args = parser.parse_args()
    rng, wrong, tried = np.random.default_rng(args.seed), Counter[str](), Counter[str]()
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        messages = robot_messages(0.4)
        samples = [
            make_sample(name, write(folder / name.replace(" ", "_"), messages))
            for name, write in WRITERS.items()
        ]
        for i in range(args.damages):
            sample = samples[i % len(samples)]
            kind = KINDS[int(rng.integers(len(KINDS)))]
            broken, at = damaged(sample.data, kind, rng)
            with tempfile.TemporaryDirectory() as place:
                said = check(sample, kind, broken, at, Path(place))
            tried[sample.name] += 1
            if said:
                wrong[sample.name] += 1
                print(f"{sample.name}, {kind} at byte {at} of {len(sample.data)}: {said}")
            if (i + 1) % 1000 == 0:
                print(f"{i + 1} damages tried, {wrong.total()} wrong", flush=True)
    for name, count in tried.items():
        print(f"{name:20} {count:6} damages, {wrong[name]} wrong")
    print(f"{sum(tried.values())} damages, {wrong.total()} wrong")
    return int(bool(wrong))


if __name__ == "__main__":
    sys.exit(main())
