# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Random faults while the robot swims, all four real drivers on one simulated clock: crashes, forbidden motion, recoveries.

    python src/fish_hw/benchmarks/driver_faults.py [--faults 500] [--seed 0]

The numbers do not depend on the computer. Processes and their messages are not in it: benchmarks/fault_campaign.py has them.
Status 1 if any count is not zero.
"""

import argparse
import sys
import tempfile
from pathlib import Path

from fish_hw.emulators.fault_run import FaultRun


def main() -> int:
    """Run the faults and print the counts."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--faults", type=int, default=500, help="how many (500)")
    parser.add_argument("--seed", type=int, default=0)
    args = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="fish_") as folder:
        run = FaultRun(Path(folder), args.seed)
        for _ in range(args.faults):
            run.fault()
    counts = run.counts
    print(f"{args.faults} faults, {run.robot.clock.now - 100.0:.0f} s of swimming and waiting")
    print(f"{'fault':16} {'times':>5} {'disarmed':>8}")
    for name, times in sorted(counts.done.items()):
        print(f"{name:16} {times:5} {counts.disarmed[name]:8}")
    print(f"crashes: {len(counts.crashes)} {counts.crashes}")
    print(
        f"commands to the rotor later than the stop allows while disarmed: {counts.moved_disarmed}"
    )
    print(
        f"commands over the limits of speed, acceleration, rudder angle and rudder rate: {counts.over_limits}"
    )
    print(
        f"not swimming again after the fault was mended and the robot armed: {counts.not_recovered}"
    )
    return 1 if counts.failed else 0


if __name__ == "__main__":
    sys.exit(main())
