# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Times and errors of the whole overhead camera chain: render, JPEG, decode, track. One core.

    python benchmarks/vision_chain.py [--frames 600]

Prints processor time per 1280 x 720 frame (median, 99th percentile), for a fish that swims through the glare
and for poses all over the pool how often it is found, and the errors of pose and tail angles.
"""

import argparse
from collections import Counter, defaultdict
from math import pi, sin
from time import thread_time

import cv2
import numpy as np

from fish_sim.camera import CameraConfig, FishPose, PoolRenderer
from fish_vision.calibration import Calibration, Lens
from fish_vision.config import TrackerConfig
from fish_vision.picture import from_compressed
from fish_vision.pose import wrap
from fish_vision.tracker import Detection, Tracker

CAMERA, TRACKER = CameraConfig(), TrackerConfig()


class Chain:
    """Renderer and tracker with a stopwatch between the stages."""

    def __init__(self) -> None:
        model = CAMERA.model()
        lens = Lens.from_camera_info(
            *model.size, "plumb_bob", model.K.ravel().tolist(), model.D.tolist()
        )
        self.calibration = Calibration(lens, TRACKER.mount())
        self.renderer = PoolRenderer(model, CAMERA.shape(), CAMERA.look())
        self.times: dict[str, list[float]] = defaultdict(list)
        self.lost: Counter[str] = Counter()

    def frame(
        self, tracker: Tracker, poses: list[FishPose], time: float, stamp: float
    ) -> Detection | None:
        """One frame through all stages."""
        t_0 = thread_time()
        picture = self.renderer.render(poses, time)
        t_1 = thread_time()
        data = self.renderer.jpeg(picture)
        t_2 = thread_time()
        image = from_compressed(data, self.calibration.lens.size)
        t_3 = thread_time()
        found = tracker.track(image, stamp)
        t_4 = thread_time()
        search = (
            "track, in ROI"
            if isinstance(found, Detection) and not found.whole_image
            else "track, whole image"
        )
        for name, took in (
            ("render", t_1 - t_0),
            ("JPEG", t_2 - t_1),
            ("decode", t_3 - t_2),
            (search, t_4 - t_3),
        ):
            self.times[name].append(took)
        if isinstance(found, Detection):
            return found
        self.lost[found.reason.value] += 1
        return None


def swim(chain: Chain, frames: int) -> int:
    """A fish that swims to and fro under the lamps, head swinging at 2 Hz, two poses per exposure."""
    tracker, found = Tracker(TRACKER, chain.calibration), 0
    for k in range(frames):
        poses = []
        for t in (k / 30.0 - 0.001, k / 30.0 + 0.001):
            heading = 0.25 * sin(4 * pi * t)
            poses.append(
                FishPose(1.9 * sin(0.15 * t), 0.6 * sin(0.47 * t), heading, (0.2 * sin(9 * t),) * 3)
            )
        found += chain.frame(tracker, poses, k / 30.0, k / 30.0) is not None
    return found


def scatter(chain: Chain, frames: int) -> tuple[np.ndarray, np.ndarray]:
    """Errors of pose (N, 3) and tail (M, 3) for random poses, each searched in the whole image."""
    random, head, tail = np.random.default_rng(0), [], []
    for k in range(frames):
        place = random.uniform([-2.06, -0.99, -pi], [2.06, 0.99, pi])
        pose = FishPose(*map(float, place), tuple(random.uniform(-0.35, 0.35, 3)))
        found = chain.frame(Tracker(TRACKER, chain.calibration), [pose], 0.37 * k, 0.0)
        if found is not None:
            head.append(
                [
                    found.head.x - pose.x,
                    found.head.y - pose.y,
                    wrap(found.head.heading - pose.heading),
                ]
            )
            if found.tail is not None:
                tail.append(np.subtract(found.tail, pose.tail))
    return np.array(head), np.array(tail)


def main() -> None:
    """Run both and print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--frames", type=int, default=600)
    frames = parser.parse_args().frames
    cv2.setNumThreads(1)
    chain = Chain()
    seen = swim(chain, frames)
    print(
        f"swimming through glare: seen in {seen} of {frames} frames ({100 * seen / frames:.2f} %)"
    )
    head, tail = scatter(chain, frames)
    print(
        f"anywhere in the pool:   seen in {len(head)} of {frames} frames ({100 * len(head) / frames:.2f} %)"
    )
    rms = np.sqrt(np.mean(head**2, axis=0))
    print(f"  position {1e3 * np.hypot(rms[0], rms[1]):.2f} mm rms, heading {rms[2]:.4f} rad rms")
    print(
        f"  tail seen in {len(tail)}, angles {np.sqrt(np.mean(tail**2, axis=0)).round(3).tolist()} rad rms"
    )
    print(f"lost: {dict(chain.lost)}")
    for name, times in chain.times.items():
        p50, p99 = np.percentile(np.array(times) * 1e3, [50, 99])
        print(
            f"{name:20s} {p50:6.2f} ms median {p99:7.2f} ms 99th percentile ({len(times)} frames)"
        )


if __name__ == "__main__":
    main()
