# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What a comparison says of recordings of one robot when an effect is put into some of them exactly, or nothing.

python src/fish_sysid/benchmarks/change_tests.py FOLDER [--new 4] [--splits 3] [--seed 0]

Trials are split into OLD and NEW at random; each of the nine injections goes into NEW at its typical strength.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import numpy as np

from fish_sim.robot import Robot
from fish_sysid.dataset.read import read_experiment
from fish_sysid.dataset.synthetic import INJECTIONS, with_injection
from fish_sysid.diagnosis.change.candidates import typical
from fish_sysid.diagnosis.change.change import Change
from fish_sysid.diagnosis.change.compare import compare
from fish_sysid.estimation.parametrization import effect_class


def main() -> None:
    """One line for every comparison, then how many were right."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("dataset", type=Path)
    parser.add_argument("--new", type=int, default=4, help="trials of NEW (default 4)")
    parser.add_argument("--splits", type=int, default=3, help="default 3")
    parser.add_argument("--seed", type=int, default=0)
    args = parser.parse_args()
    experiment, _ = read_experiment(args.dataset)
    random, right = np.random.default_rng(args.seed), dict.fromkeys(("", *INJECTIONS), 0)
    for _ in range(args.splits):
        order = random.permutation(len(experiment.names))
        new = experiment.select(sorted(order[: args.new]))
        old = experiment.select(sorted(order[args.new :]))
        for name in right:
            began = time.process_time()
            values = {k: typical(name, k) for k in effect_class(name).strength} if name else {}
            changed = with_injection(new, name, values) if name else new
            change = compare(changed, [old], Robot(), fit=False)
            members = [m.name for named in change.named for m in named.members]
            right[name] += name in members if name else change.verdict == "unchanged"
            print(line(name, change, time.process_time() - began), flush=True)
    for name, count in right.items():
        print(f"{name or 'nothing':24s} {count} of {args.splits}")


def line(name: str, change: Change, seconds: float) -> str:
    """One comparison on one line."""
    families = "; ".join(", ".join(m.name for m in named.members) for named in change.named)
    rest = f"{change.verdict}, p {change.p_value:.3f}, rest {change.remainder_p_value:.3f}"
    return f"{name or 'nothing':24s} {rest}: {families or '-'} ({seconds:.0f} s)"


if __name__ == "__main__":
    main()
