# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Write the recordings of this example again: a fish with form drag that its model lacks, and other drags and stiffness.

Into this example's own folder, whose recordings are replaced, or into a new or empty folder that is given.
"""

import shutil
import sys
from pathlib import Path

from fish_report.errors import UserError
from fish_report.files import new_folder
from fish_study.build import make_recordings
from fish_study.scenario import Scenario

SCENARIO = Scenario(
    group="example",
    seed=20261121,
    effects={"quadratic_drag": {"surge": 0.6, "sway": 4.0, "yaw": 1.2e-3}},
    count=9,
    duration=12.0,
    parameters={
        "head_drag_surge": 0.85,
        "head_drag_sway": 1.15,
        "tail_stiffness": 1.1,
        "rotor_inertia": 0.95,
    },
)

OWN = Path(__file__).parent / "recordings"


def folder_of(words: list[str]) -> Path:
    """The folder to write into, empty or not there: what lies in a folder that is not this script's stays. Raises UserError."""
    if words:
        return new_folder(Path(words[0]), "hidden_drag")
    shutil.rmtree(OWN, ignore_errors=True)
    return OWN


def as_files(folder: Path) -> None:
    """A file for each trial in the place of its folder: an MCAP file needs no metadata.yaml."""
    for file in sorted(folder.glob("*/*.mcap")):
        file.rename(folder / file.name)
        shutil.rmtree(file.parent)


if __name__ == "__main__":
    try:
        folder = folder_of(sys.argv[1:])
        make_recordings(SCENARIO, folder)
        as_files(folder)
    except UserError as error:
        sys.exit(str(error))
