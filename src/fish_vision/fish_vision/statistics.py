# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What the tracker did lately: counts, times, and whether the calibration still fits. For diagnostics."""

from collections import Counter, deque

import numpy as np

from fish_vision.choice import Reason
from fish_vision.tracker import Detection, Lost

RECENT = 300  # samples of a time
SPACINGS = 60  # poses before the markers' spacing is judged
SPACING_LIMIT = 0.015  # share by which the mean spacing may differ from the true one
SCATTER = 0.01  # standard deviation, share, of spacings that come from one wrong scale


class Statistics:
    """Counts of results since the start; recent times and spacings."""

    def __init__(self) -> None:
        self.tracked = 0
        self.whole_image = 0
        self.lost: Counter[str] = Counter()  # reason -> images
        self.refused: Counter[str] = Counter()  # bad message -> images
        self.last_error = ""  # text of the newest bad message
        self.last_reason = ""  # of the newest lost image
        self._spacings: deque[float] = deque(maxlen=SPACINGS)
        self._refused_spacings: deque[float] = deque(
            maxlen=SPACINGS
        )  # since the last pose, less one
        self._work: deque[float] = deque(maxlen=RECENT)
        self._age: deque[float] = deque(maxlen=RECENT)

    def add(self, found: Detection | Lost, work: float, age: float) -> None:
        """One image: result, time it took (s), time from its stamp to the result (s)."""
        self._work.append(work)
        self._age.append(age)
        if isinstance(found, Lost):
            self.last_reason = found.reason.value
            self.lost[self.last_reason] += 1
            if found.reason in (Reason.NO_PAIR, Reason.TAG_SIZE) and found.spacing is not None:
                self._refused_spacings.append(found.spacing)
            return
        self._refused_spacings.clear()
        self.tracked += 1
        self.whole_image += found.whole_image
        self._spacings.append(found.spacing)

    def refuse(self, kind: str, error: str) -> None:
        """One message that could not be used."""
        self.refused[kind] += 1
        self.last_error = error

    @property
    def images(self) -> int:
        """Images looked at, with or without result."""
        return self.tracked + sum(self.lost.values())

    def spacing_error(self) -> float | None:
        """Mean misfit (share) of the markers' spacing if it shows a wrong calibration, else None."""
        if len(self._spacings) < SPACINGS:
            return None
        error = float(np.mean(self._spacings)) - 1.0
        return error if abs(error) > SPACING_LIMIT else None

    def refused_spacing(self) -> float | None:
        """Mean misfit (share) of the markers' spacing where every image is refused for the same one, else None.

        A camera_info with a focal length 5 % too short shows all distances 5 % too long, and a fish at the pool's
        end 0.1 m off.
        """
        values = np.array(self._refused_spacings)
        if len(values) < SPACINGS or float(np.std(values)) > SCATTER:
            return None
        return float(np.mean(values))

    def values(self) -> dict[str, str]:
        """All numbers, ready for a diagnostic message."""
        result = {"tracked": str(self.tracked), "from_whole_image": str(self.whole_image)}
        result |= {f"lost: {reason}": str(n) for reason, n in self.lost.items()}
        result |= {f"refused: {kind}": str(n) for kind, n in self.refused.items()}
        for name, times in (("processing_ms", self._work), ("stamp_to_pose_ms", self._age)):
            if times:
                p50, p99 = np.percentile(np.array(times) * 1e3, [50, 99])
                result |= {f"{name}_p50": f"{p50:.2f}", f"{name}_p99": f"{p99:.2f}"}
        return result
