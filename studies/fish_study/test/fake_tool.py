# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""A stand-in for `robofish diagnose`: answers at once, from nothing but the name and size of what it was given."""

import json
import sys
from pathlib import Path


def main() -> int:
    recordings, out = Path(sys.argv[1]), Path(sys.argv[sys.argv.index("--out") + 1])
    if recordings.parent.name == "scenario_0001":
        print("cannot", file=sys.stderr)
        return 3
    if recordings.parent.name == "scenario_0002" and not (recordings.parent / "stopped").exists():
        (recordings.parent / "stopped").touch()
        return 130
    trials = sorted(path.name for path in recordings.iterdir())
    rms = {"2 s": {"position_m": 0.01, "heading_rad": 0.01, "speed_m_s": 0.01}}
    answer = {
        "verdict": "no_mismatch",
        "effects": [],
        "unexplained": {},
        "fit": {"held_out_trials": trials[2::3], "with_effects": {"rms": rms}},
        "seen": {"arguments": sys.argv[1:], "trials": trials},
    }
    out.mkdir(parents=True)
    (out / "diagnosis.json").write_text(json.dumps(answer))
    return 0


if __name__ == "__main__":
    sys.exit(main())
