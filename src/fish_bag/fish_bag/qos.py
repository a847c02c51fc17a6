"""Quality of service as recordings store it: what decides whether publisher and subscriber meet."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Qos:
    """Policies of one publisher; the others keep their defaults."""

    reliable: bool = True
    transient_local: bool = False
    depth: int = 10

    def profiles(self) -> list[dict[str, Any]]:
        """As `offered_qos_profiles` of rosbag2 (metadata version 9): a list of one profile."""
        unset = {"sec": 0, "nsec": 0}
        return [
            {
                "history": "keep_last",
                "depth": self.depth,
                "reliability": "reliable" if self.reliable else "best_effort",
                "durability": "transient_local" if self.transient_local else "volatile",
                "deadline": dict(unset),
                "lifespan": dict(unset),
                "liveliness": "automatic",
                "liveliness_lease_duration": dict(unset),
                "avoid_ros_namespace_conventions": False,
            }
        ]
