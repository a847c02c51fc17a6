"""Write the recordings of this example again: a fish with form drag that its model lacks, and other drags and stiffness."""

import shutil
import sys
from pathlib import Path

from fish_train.prove.build import make_world
from fish_train.prove.world import World

WORLD = World(
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

if __name__ == "__main__":
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent / "recordings"
    shutil.rmtree(folder, ignore_errors=True)
    make_world(WORLD, folder)
