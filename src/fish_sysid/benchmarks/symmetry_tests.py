# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What the symmetry tests find in data sets, as they are or with a known effect put in exactly.

python src/fish_sysid/benchmarks/symmetry_tests.py FOLDER... [--inject-current VX VY] [--inject-latency S]
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

from fish_sim.robot import Robot
from fish_sysid.dataset.read import read_experiment
from fish_sysid.dataset.synthetic import with_current, with_image_age
from fish_sysid.diagnosis.symmetry.finding import SymmetryFinding
from fish_sysid.diagnosis.symmetry.findings import symmetry_findings


def main() -> None:
    """Print a table for every data set."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("dataset", type=Path, nargs="+")
    parser.add_argument("--inject-current", type=float, nargs=2, metavar=("VX", "VY"))
    parser.add_argument("--inject-latency", type=float, metavar="S")
    args = parser.parse_args()
    for path in args.dataset:
        experiment, left_out = read_experiment(path)
        if args.inject_current:
            experiment = with_current(experiment, tuple(args.inject_current))
        if args.inject_latency:
            experiment = with_image_age(experiment, args.inject_latency)
        start = time.monotonic()
        findings = symmetry_findings(experiment, Robot())
        trials, seconds = len(experiment.names), time.monotonic() - start
        print(f"{path}: {trials} trials, {len(left_out)} left out, {seconds:.1f} s")
        for finding in findings:
            print(f"  {line(finding)}")


def line(finding: SymmetryFinding) -> str:
    """One test on one line."""
    parts = [f"{finding.name:38s} {finding.status:11s}"]
    if finding.evidence:
        e = finding.evidence
        parts.append(f"gain {e.gain:.2f} ± {e.std:.2f} (p {e.p_value:.1g})")
    parts += [f"{k} {v.value:.4g} ± {v.std:.2g} {v.unit}" for k, v in finding.parameters.items()]
    return "  ".join([*parts, finding.reason])


if __name__ == "__main__":
    main()
