# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""How often the symmetry tests name a flow or a clock where there is one, and where there is none.

    python studies/symmetry_worlds.py [--worlds 100] [--mujoco 20] [--seed 1]

--worlds are drawn from all groups of the blind study, among them feedback alone, one speed and walls. --mujoco worlds are fish of
the second plant whose water moves or whose images are old, in turn (needs requirements-bench.txt). The tests do not see a label.
"""

from __future__ import annotations

import argparse
import tempfile
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
from statsmodels.stats.proportion import proportion_confint

from fish_sim.robot import Robot
from fish_study.build import make_recordings
from fish_study.scenario import Scenario, ScenarioError
from fish_study.scenario_groups import draw_scenarios, mujoco
from fish_sysid.dataset.read import read_experiment
from fish_sysid.diagnosis.symmetry.findings import symmetry_findings

GROUPS = ["single", "absorbed", "feedback", "noise", "ladder", "two", "sensor", "outside", "null"]
FLOWS = ("current", "nonuniform_current", "sloshing", "tether")  # push in the pool's frame
CLOCKS = ("camera_latency", "imu_latency")
TRUE = {"wind": "current", "image_age": "camera_latency"}  # what is concealed in the second plant
TRIALS, SECONDS = 9, 12.0  # of a world of the second plant


def main() -> None:
    """A line for every world that is named wrongly or missed, then a table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--worlds", type=int, default=100, help="default 100")
    parser.add_argument("--mujoco", type=int, default=20, help="default 20")
    parser.add_argument("--seed", type=int, default=1)
    args = parser.parse_args()
    counts: dict[tuple[str, str], list[bool]] = defaultdict(list)
    for scenario in scenarios(args.worlds, args.mujoco, args.seed):
        found = findings(scenario)
        if found is None:
            continue
        hidden = {TRUE.get(name, name) for name in scenario.names}
        for kind, names, said in (("flow", FLOWS, "current"), ("clock", CLOCKS, "camera_latency")):
            there, named = bool(hidden & set(names)), said in found
            if said in hidden or not there:
                what = "has it" if there else "has none"
                counts[f"{scenario.group}: {what}", kind].append(named)
            if named != there:
                print(f"{scenario.group:9s} {kind}: named {named}, hidden {hidden or 'nothing'}")
    print(f"\n{'worlds':28s} {'kind':6s} named")
    for (group, kind), answers in sorted(counts.items()):
        low, high = proportion_confint(sum(answers), len(answers), method="wilson")
        share = f"{sum(answers)} of {len(answers)} ({100 * low:.0f} to {100 * high:.0f} %)"
        print(f"{group:28s} {kind:6s} {share}")


def scenarios(worlds: int, plants: int, seed: int) -> Iterator[Scenario]:
    """Worlds of all groups, then those of the second plant."""
    if worlds:
        yield from draw_scenarios(worlds, GROUPS, seed)
    random = np.random.default_rng(seed)
    for number in range(plants):
        names, one = tuple(TRUE), mujoco(random, number)
        from fish_study.mujoco_effects import drawn

        name = names[number % len(names)]
        yield replace(one, effects={name: drawn(name, random)}, count=TRIALS, duration=SECONDS)


def findings(scenario: Scenario) -> set[str] | None:
    """Names that the symmetry tests state of the scenario's recordings; None where it cannot be made."""
    with tempfile.TemporaryDirectory() as folder:
        try:
            make_recordings(scenario, Path(folder) / "recordings")
        except ScenarioError as problem:
            print(f"{scenario.group}: no world ({problem})")
            return None
        experiment, _ = read_experiment(Path(folder) / "recordings")
    found = symmetry_findings(experiment, Robot())
    return {one.name for one in found if one.status == "found"}


if __name__ == "__main__":
    main()
