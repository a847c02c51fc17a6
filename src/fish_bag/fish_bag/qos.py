# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Quality of service as recordings store it: what decides whether publisher and subscriber meet."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import yaml

LARGEST_DEPTH = 100_000  # messages; damaged texts may hold any number


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


def parse_qos(text: str) -> Qos:
    """What the publishers offered, from `offered_qos_profiles` as YAML; the usual policies where nothing is said.

    Policies stand by name (metadata version 9 on) or by number (before).
    """
    try:
        profiles = yaml.safe_load(text) if text else []
    except (yaml.YAMLError, ValueError, RecursionError):
        profiles = []
    given = [p for p in profiles if isinstance(p, dict)] if isinstance(profiles, list) else []
    if not given:
        return Qos()
    depth = given[0].get("depth")
    return Qos(
        reliable=all(p.get("reliability") not in ("best_effort", 2) for p in given),
        transient_local=all(p.get("durability") in ("transient_local", 1) for p in given),
        depth=depth if isinstance(depth, int) and 1 <= depth <= LARGEST_DEPTH else Qos().depth,
    )
