# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Write two days of one fish: `yesterday`, and `today` in water that moves. Neither drags nor stiffness are the model's.

python examples/what_changed/make_recordings.py FOLDER

FOLDER is new or empty; some seconds, the first time some minutes, as kernels are compiled; 4 MB.
"""

import sys
from pathlib import Path

from fish_report.errors import UserError
from fish_report.files import new_folder
from fish_study.pair_recordings import NEW, OLD, make_pair
from fish_study.scenario import Scenario

SCENARIO = Scenario(
    group="example",
    seed=20261127,
    effects={"current": {"x": 0.03, "y": -0.02}},
    old=12,
    count=6,
    duration=12.0,
    links=4,  # the model has three
    substeps=4,
    parameters={
        "head_drag_surge": 0.85,
        "head_drag_sway": 1.15,
        "tail_stiffness": 1.1,
        "rotor_inertia": 0.95,
    },
)


def write_days(folder: Path) -> None:
    """Write the folders `yesterday` and `today` of a new or empty folder. Raises UserError for another one."""
    new_folder(folder, "what_changed")
    if folder.exists():
        folder.rmdir()
    make_pair(SCENARIO, folder)
    (folder / OLD).rename(folder / "yesterday")
    (folder / NEW).rename(folder / "today")


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("expected one folder, new or empty: python make_recordings.py FOLDER")
    try:
        write_days(Path(sys.argv[1]))
    except UserError as error:
        sys.exit(str(error))
