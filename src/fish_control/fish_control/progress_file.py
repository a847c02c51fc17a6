"""The planner's progress on disk, so that a planner that was killed goes on where it was.

Odometry alone cannot say where on a self-crossing path the robot is, and topics of a killed publisher are
gone. The file is removed when the planner ends as it should.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
from dataclasses import asdict, dataclass
from pathlib import Path

from fish_control.reference_path import ReferencePath


@dataclass(frozen=True)
class SavedProgress:
    """Where a planner was."""

    path: str  # digest of the path
    time: float  # s, stamp of the odometry
    progress: float  # m


def path_digest(path: ReferencePath) -> str:
    """Same for the same points, to a millimetre, and the same end."""
    content = (path.points * 1000.0).round().astype("int64").tobytes() + f"{path.closed} {path.end}".encode()
    return hashlib.sha256(content).hexdigest()[:16]


def save_progress(file: Path, saved: SavedProgress) -> None:
    """Replace the file in one step. Raises OSError."""
    new = file.with_name(file.name + ".new")
    new.write_text(json.dumps(asdict(saved)), encoding="utf-8")
    os.replace(new, file)


def load_progress(file: Path) -> SavedProgress | None:
    """What was saved; None if there is none or it is damaged."""
    try:
        data = json.loads(file.read_text(encoding="utf-8"))
        saved = SavedProgress(str(data["path"]), float(data["time"]), float(data["progress"]))
    except (OSError, ValueError, KeyError, TypeError):
        return None
    return (
        saved
        if math.isfinite(saved.time) and math.isfinite(saved.progress) and saved.progress >= 0.0
        else None
    )
