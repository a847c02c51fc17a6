# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Accuracy, wrong poses and speed of the tracker, 1920 x 1080 over 4.27 m, with rival fish, toys and reflections.

    python benchmarks/tracker_scenarios.py [--frames 1000] [--speed 600] [--only NAME ...]

A pose is wrong if it is more than 20 mm or 10 degrees from the own fish, also while that is hidden. Every scenario runs
in episodes of 10 s with a new tracker. Prints for each the share of frames with a right pose, the wrong poses, and the
errors of the right ones, the mean of their NEES (3 where the covariance is right) and the share of it above what 1 % of the
poses should exceed. Then it prints how many frames the tracker takes in a second of processor time, and how many a
plain OpenCV pipeline takes of the same pictures. The fish of the scenarios tags_* carries a coded tag of 50 mm.
"""

import argparse
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace
from math import degrees, hypot, radians
from time import thread_time

import cv2
import numpy as np
from pool_scenes import ALONE, RIVALS, SHAPE, TAGGED, Scenario, Scene, exposure, swapped

from fish_sim.camera import CameraConfig, FishShape, Patch, PoolRenderer, patches
from fish_vision.calibration import Calibration, Lens
from fish_vision.config import TrackerConfig
from fish_vision.follower import make_follower
from fish_vision.picture import from_compressed
from fish_vision.pose import wrap
from fish_vision.tags import tag_picture
from fish_vision.tracker import Detection, Tracker

HD = CameraConfig(width=1920, height=1080, focal=(1500.0, 1500.0), centre=(951.0, 549.0))
TRACKER = TrackerConfig()
TAGS = replace(TRACKER, marker_kind="tags", tail_links=0)
RATE, EPISODE = 30.0, 300  # frames/s, frames of one tracker
NEES_MOST = 11.34  # chi^2 of 3 at 99 %
FAR, TURNED = 0.020, radians(10.0)  # a pose further off is wrong
PAPER, INK = (235, 235, 235), (20, 20, 20)  # of a printed tag


class Studio:
    """The camera with what it takes to track in its pictures.

    One picture of the still pool serves all frames: only what is drawn gets fresh noise and JPEG, which costs a tenth
    of whole pictures. With glare, which moves, every picture is whole.
    """

    def __init__(self, glare: float, shape: FishShape = SHAPE) -> None:
        config = replace(HD, glare=glare)
        self.shape = shape
        self.calibration, self.renderer = camera(config, shape)
        self.whole = glare > 0.0
        self.random = np.random.default_rng(0)
        pool = PoolRenderer(config.model(), shape, replace(config.look(), noise_std=0.0))
        self.still = pool.render([], 0.0).copy()
        self.taken = self._sent(self.renderer.render([], 0.0))

    def picture(self, scene: Scene, time: float) -> np.ndarray:
        """What the tracker gets."""
        poses = scene.poses if scene.drawn else []
        if self.whole:
            return self._sent(self.renderer.render(poses, time, scene.below, scene.above))
        clean, result = self.still.copy(), self.taken.copy()
        self.renderer.draw(clean, poses, scene.below, scene.above)
        outlines = [patch.outline for pose in poses for patch in patches(pose, self.shape)]
        things = [outlines] if outlines else []
        things += [[patch.outline for patch in thing] for thing in (*scene.below, *scene.above)]
        for thing in things:
            left, top, right, bottom = self._blocks(np.vstack(thing))
            part = clean[top:bottom, left:right]
            if part.size:
                noise = self.random.normal(0.0, 3.0, part.shape)
                noisy = np.clip(np.round(part + noise), 0, 255).astype(np.uint8)
                result[top:bottom, left:right] = self._sent(noisy)
        return (
            result if scene.light == (1.0, 1.0, 1.0) else cv2.multiply(result, (*scene.light, 1.0))
        )

    def _blocks(self, outline: np.ndarray) -> tuple[int, int, int, int]:
        """Box around an outline that ends between JPEG's blocks of 16 pixels."""
        pixels = self.calibration.pool_to_pixel(outline)
        low = np.maximum(np.floor((pixels.min(axis=0) - 6) / 16).astype(int) * 16, 0)
        high = np.ceil((pixels.max(axis=0) + 6) / 16).astype(int) * 16
        right, bottom = np.clip(high, 0, self.calibration.lens.size)
        return int(low[0]), int(low[1]), int(right), int(bottom)

    def _sent(self, picture: np.ndarray) -> np.ndarray:
        """The picture after JPEG."""
        return from_compressed(self.renderer.jpeg(picture), picture.shape[1::-1])

    def frames(self, scenario: Scenario, count: int) -> Iterator[tuple[int, Scene, np.ndarray]]:
        """Number in its episode, scene and picture of each frame."""
        for k in range(count):
            episode, frame = divmod(k, EPISODE)
            scene = scenario(frame / RATE, 0.37 * episode, np.random.default_rng(episode))
            yield frame, scene, self.picture(scene, k / RATE)


def tagged(dictionary: str, size: float) -> FishShape:
    """The fish with tag 0 of a dictionary on its head; size: of the black square, m."""
    picture = tag_picture(dictionary, 0)
    cells = len(picture)
    edge = size / cells

    def square(row: float, column: float, side: float, colour: tuple[int, int, int]) -> Patch:
        corners = np.array([[column, -row], [column + side, -row]] * 2)
        corners[2:] = corners[1::-1] - [0.0, side]
        return Patch(edge * (corners + [-cells / 2, cells / 2]), colour)

    plates = [square(-1, -1, cells + 2, PAPER), square(0, 0, cells, INK)]
    plates += [square(i, j, 1, PAPER) for i, j in np.argwhere(picture)]
    return replace(SHAPE, plates=tuple(plates))


TAG_FISH = tagged(TAGS.tag_dictionary, TAGS.tag_size)


def camera(config: CameraConfig, shape: FishShape = SHAPE) -> tuple[Calibration, PoolRenderer]:
    """The tracker's and the renderer's side of a camera."""
    model = config.model()
    lens = Lens.from_camera_info(
        *model.size, "plumb_bob", model.K.ravel().tolist(), model.D.tolist()
    )
    return (
        Calibration(lens, TRACKER.mount()),
        PoolRenderer(model, shape, config.look()),
    )


@dataclass
class Score:
    """Right and wrong poses of a scenario, the errors of the right ones (N, 2): m, rad, and their NEES (N,)."""

    frames: int
    wrong: int
    errors: np.ndarray
    nees: np.ndarray
    lost: Counter[str]

    def line(self, name: str) -> str:
        """One row of the table."""
        head = f"{name:11s} {self.frames:6d} {100 * len(self.errors) / self.frames:7.2f} % {self.wrong:6d}"
        if not len(self.errors):
            return f"{head}   {dict(self.lost)}"
        rms = np.sqrt(np.mean(self.errors**2, axis=0))
        most = np.percentile(np.abs(self.errors), 99, axis=0)
        return (
            f"{head} {1e3 * rms[0]:7.2f} {1e3 * most[0]:7.2f} {degrees(rms[1]):8.3f} "
            f"{degrees(most[1]):8.3f} {self.nees.mean():7.2f} {100 * np.mean(self.nees > NEES_MOST):5.1f} %   "
            f"{dict(self.lost)}"
        )


def score(studio: Studio, scenario: Scenario, count: int) -> Score:
    """Run one scenario."""
    config = TAGS if studio.shape.plates else TRACKER
    errors, nees, wrong, lost = [], [], 0, Counter[str]()
    tracker = make_follower(config, studio.calibration)
    for frame, scene, picture in studio.frames(scenario, count):
        if frame == 0:
            tracker = make_follower(config, studio.calibration)
        found = tracker.track(picture, frame / RATE)
        if not isinstance(found, Detection):
            lost[found.reason.value] += 1
            continue
        x, y = np.mean([[p.x, p.y] for p in scene.poses], axis=0)
        heading = (
            scene.poses[0].heading + wrap(scene.poses[-1].heading - scene.poses[0].heading) / 2
        )
        off = hypot(found.head.x - x, found.head.y - y), wrap(found.head.heading - heading)
        if off[0] > FAR or abs(off[1]) > TURNED or (not scene.drawn and scenario is not swapped):
            wrong += 1
        else:
            errors.append(off)
            error = np.array([found.head.x - x, found.head.y - y, off[1]])
            nees.append(float(error @ np.linalg.solve(found.head.covariance, error)))
    return Score(count, wrong, np.array(errors), np.array(nees), lost)


class PlainPipeline:
    """What a first program with OpenCV does: undistort, HSV, four masks, largest contours, their moments."""

    def __init__(self, calibration: Calibration) -> None:
        lens = calibration.lens
        self.maps = cv2.initUndistortRectifyMap(
            lens.K, lens.D, None, lens.K, lens.size, cv2.CV_16SC2
        )
        self.H = np.linalg.inv(calibration.H)

    def pose(self, picture: np.ndarray) -> tuple[np.ndarray, float] | None:
        """Middle of the head's markers (2,), m, and heading, rad."""
        flat = cv2.remap(picture, *self.maps, cv2.INTER_LINEAR)
        hsv = cv2.cvtColor(flat, cv2.COLOR_BGR2HSV)
        middles = []
        for marker in ("front", "rear", "tail_odd", "tail_even"):
            mask = TRACKER.colour(marker).mask(hsv)
            contours, _ = cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
            if not contours:
                return None
            m = cv2.moments(max(contours, key=cv2.contourArea))
            if not m["m00"]:
                return None
            middles.append(self.H @ [m["m10"] / m["m00"], m["m01"] / m["m00"], 1.0])
        front, rear, *_ = (place[:2] / place[2] for place in middles)
        return (front + rear) / 2, float(np.arctan2(*(front - rear)[::-1]))


def speed(count: int) -> None:
    """Frames a second of processor time in the region of interest, and of the plain pipeline, for two sizes."""
    for config in (CameraConfig(), HD):
        calibration, renderer = camera(replace(config, glare=0.0))
        tracker, plain, times = Tracker(TRACKER, calibration), PlainPipeline(calibration), []
        for frame in range(count):
            picture = renderer.render(exposure(frame / RATE, 0.0), frame / RATE)
            start = thread_time()
            found = tracker.track(picture, frame / RATE)
            between = thread_time()
            plain.pose(picture)
            if isinstance(found, Detection) and not found.whole_image:
                times.append((between - start, thread_time() - between))
        if not times:
            print(
                f"{config.width} x {config.height}: no frame in the region of interest; expected --speed 2 or more"
            )
            continue
        own, other = np.median(times, axis=0)
        print(
            f"{config.width} x {config.height}: tracker {1 / own:.0f} frames/s, plain OpenCV pipeline "
            f"{1 / other:.0f} frames/s, ratio {other / own:.1f} (medians of {len(times)} frames)"
        )


def main() -> None:
    """Run what is asked and print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--frames", type=int, default=1000, help="of each scenario")
    parser.add_argument("--speed", type=int, default=600, help="frames of the speed measurement")
    names = [*ALONE, *TAGGED, *RIVALS]
    parser.add_argument("--only", nargs="+", choices=names, default=names, help="scenarios")
    args = parser.parse_args()
    cv2.setNumThreads(1)
    if args.speed:
        speed(args.speed)
    print(
        f"{'scenario':11s} frames    right  wrong  mm rms     p99  deg rms      p99    NEES above   lost"
    )
    studios: dict[tuple[float, bool], Studio] = {}
    total = Counter[str]()
    for name in args.only:
        scenario, glare = (ALONE | TAGGED | RIVALS)[name]
        key = glare, name in TAGGED
        if key not in studios:
            studios[key] = Studio(glare, TAG_FISH if name in TAGGED else SHAPE)
        studio = studios[key]
        result = score(studio, scenario, args.frames)
        print(result.line(name), flush=True)
        if name in RIVALS:
            total["frames"] += result.frames
            total["wrong"] += result.wrong
    if total["frames"]:
        print(f"wrong poses with rivals: {total['wrong']} of {total['frames']}")


if __name__ == "__main__":
    main()
