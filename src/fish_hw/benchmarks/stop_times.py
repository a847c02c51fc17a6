# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""How long a stop takes: from its cause to the last command that is not zero, and until the module drives no more.

    python src/fish_hw/benchmarks/stop_times.py [--times 20]

The real driver swims an emulated module at 2 Hz; both are on one simulated clock, so that the numbers do not depend on the
computer. What a network and a busy computer add is not in them. Status 1 if a cause takes longer than allowed.
"""

import argparse
import statistics
import sys

from fish_hw.emulators.stop_causes import CAUSES, limit_s, stop


def main() -> int:
    """Print a line for each cause."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--times", type=int, default=20, help="stops of each cause (20)")
    times = parser.parse_args().times
    print(f"{'cause':45} {'median':>7} {'max':>7} {'coasts':>7} {'allowed':>8}   s; reason said")
    late = []
    for cause in CAUSES:
        stops = [stop(cause, seed) for seed in range(times)]
        last = [one.last_command_s for one in stops]
        coasts = max(one.coasting_s for one in stops)
        print(
            f"{cause:45} {statistics.median(last):7.3f} {max(last):7.3f} {coasts:7.3f} {limit_s(cause):8.2f}   {stops[-1].reason}"
        )
        if max(last) > limit_s(cause):
            late.append(cause)
    print(
        f"{len(CAUSES)} causes, {times} stops each; later than allowed: {', '.join(late) or 'none'}"
    )
    return 1 if late else 0


if __name__ == "__main__":
    sys.exit(main())
