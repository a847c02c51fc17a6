# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""How far the numbers of a name are from what was changed on the second plant: python studies/pair_numbers.py [STUDY].

STUDY is a folder or an archive of a study of the group `mujoco-pair`, by default the one that comes with the project.
"""

import sys
from collections import defaultdict
from pathlib import Path

import numpy as np

from fish_report.page import Table
from fish_report.terminal import print_table, terminal
from fish_study.study import opened_studies

NEWEST = Path(__file__).parent / "data" / "pairs.tar.xz"
# parameter of the plant -> parameter of the vocabulary, its unit; without one the ratio is told
SAME = {
    ("image_age", "delay"): ("camera_latency", "delay", "s"),
    ("servo_trim", "angle"): ("rudder_offset", "offset", "rad"),
    ("wind", "x"): ("current", "x", "m/s"),
    ("wind", "y"): ("current", "y", "m/s"),
    ("servo_filter", "time"): ("rudder_lag", "time_constant", ""),
    ("ballast", "mass"): ("payload", "mass", ""),
}


def main() -> None:
    """One row for each parameter."""
    file = Path(sys.argv[1]) if len(sys.argv) > 1 else NEWEST
    found = defaultdict(list)
    with opened_studies([file]) as studies:
        for study in studies:
            for scenario, label in study.open_labels().items():
                effects = (study.results[scenario]["diagnosis"] or {}).get("effects", [])
                named = {effect["name"]: effect["parameters"] for effect in effects}
                for (effect, key), (name, parameter, unit) in SAME.items():
                    if effect in label.effects and name in named:
                        said, true = named[name][parameter], label.effects[effect][key]
                        found[effect, key, unit].append((said["value"], said["std"], true))
    rows = []
    for (effect, key, unit), values in found.items():
        value, std, true = np.array(values).T
        if unit:
            apart, errors = value - true, np.sqrt(np.mean(((value - true) / std) ** 2))
            cells = [f"{apart.min():+.4f} to {apart.max():+.4f} {unit}", f"{errors:.1f}"]
        else:
            ratio = value / true
            cells = [f"{ratio.min():.2f} to {ratio.max():.2f} times", "–"]
        rows.append([f"{effect}.{key}", ".".join(SAME[effect, key][:2]), str(len(value)), *cells])
    header = ["changed", "said", "pairs", "off by", "in standard errors, RMS"]
    print_table(
        terminal(), Table("Numbers of the names", header, rows, "Where that name was said.")
    )


if __name__ == "__main__":
    main()
