# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Whether what predictions name is what was put in, on recordings of a fish that no model can follow.

    python benchmarks/names_by_prediction.py RECORDINGS [--only NAME ...] [--out DIR]

The recordings are diagnosed as they are, then with one exact change at a time: a rudder that goes less or farther, whose zero is
off or that is late, and water that moves. What is named with a change and not without it, or with other values, is the answer
to the change. Two lines per diagnosis: verdict, names with their values and what ties with them, what the symmetry tests found;
how far model.yaml and the refitted nominal model are off after 1 s on held-out runs. DIR keeps every diagnosis, so that a run
that was stopped goes on.
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path

from fish_report.files import write_json
from fish_sim.robot import Robot
from fish_sysid.dataset.read import read_experiment
from fish_sysid.dataset.synthetic import with_injection
from fish_sysid.diagnosis.diagnosis_json import answer
from fish_sysid.diagnosis.pipeline import diagnose

CHANGES: dict[str, tuple[str, dict[str, float]]] = {
    "gain 0.75": ("rudder_gain", {"factor": 0.75}),
    "gain 1.4": ("rudder_gain", {"factor": 1.4}),
    "zero +0.15": ("rudder_offset", {"offset": 0.15}),
    "zero -0.15": ("rudder_offset", {"offset": -0.15}),
    "zero +0.06": ("rudder_offset", {"offset": 0.06}),
    "late by 0.25 s": ("rudder_delay", {"delay": 0.25}),
    "water": ("current", {"x": 0.03, "y": -0.02}),
}


def main() -> None:
    """Diagnose, print a line each."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("recordings", type=Path)
    parser.add_argument("--only", nargs="+", choices=["none", *CHANGES], help="these (all)")
    parser.add_argument("--out", type=Path, default=Path("out/names_by_prediction"))
    args = parser.parse_args()
    experiment, _ = read_experiment(args.recordings)
    args.out.mkdir(parents=True, exist_ok=True)
    for label in args.only or ["none", *CHANGES]:
        kept, begin = args.out / f"{label.replace(' ', '_')}.json", time.process_time()
        if not kept.exists():
            changed = experiment
            if label in CHANGES:
                changed = with_injection(experiment, *CHANGES[label])
            write_json(kept, answer(diagnose(changed, Robot())))
        content = json.loads(kept.read_text())
        named = "; ".join(_named(effect) for effect in content["effects"]) or "no name"
        seconds = time.process_time() - begin
        print(f"{label:15} {content['verdict']}: {named} ({seconds:.0f} s of one core)")
        print(f"{'':15} {_found(content)}; {_errors(content['fit'])}", flush=True)


def _named(effect: dict) -> str:  # type: ignore[type-arg]
    values = ", ".join(f"{p['value']:.3g}" for p in effect["parameters"].values())
    ties = "".join(f" or {rival['name']}" for rival in effect["rivals"])
    return f"{effect['name']} {values}{ties} [{effect['evidence']['basis']}]"


def _found(content: dict) -> str:  # type: ignore[type-arg]
    return "; ".join(f["statement"] for f in content["symmetry"] if f["statement"]) or "no symmetry"


def _errors(fit: dict) -> str:  # type: ignore[type-arg]
    one, other = (1e3 * fit[m]["rms"]["1 s"]["position_m"] for m in ("model_yaml", "refitted"))
    return f"model.yaml {one:.0f} mm, refitted nominal model {other:.0f} mm after 1 s"


if __name__ == "__main__":
    main()
