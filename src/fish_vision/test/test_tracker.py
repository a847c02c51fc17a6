# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The tracker on drawn pictures: poses, reasons when there is none, what it refuses; the low-pass over its poses; counts and
judgements for the diagnostics.
"""

from dataclasses import replace
from math import cos, pi, sin, sqrt

import cv2
import numpy as np
import pytest
from pool_picture import BODY, CONFIG, SCALE, SIZE, calibration, discs_of_fish, draw, lens_fields

from fish_vision.annotate import annotated, tail_points
from fish_vision.calibration import POOL, Calibration, Lens
from fish_vision.choice import Reason
from fish_vision.detections import SPACINGS, PoseLowPass, Statistics
from fish_vision.pose import HeadPose, wrap
from fish_vision.tracker import Detection, Lost, Tracker

CUTOFF, RATE = 2.0, 200.0  # Hz


@pytest.fixture
def tracker() -> Tracker:
    return Tracker(CONFIG, calibration())


def seen(found: Detection | Lost) -> Detection:
    assert isinstance(found, Detection), found
    return found


def reason(found: Detection | Lost) -> Reason:
    assert isinstance(found, Lost), found
    return found.reason


@pytest.mark.parametrize(
    "pose", [(0.0, 0.0, 0.0), (1.9, 0.9, 2.5), (-1.95, -0.9, -2.0), (-0.5, 0.4, -pi / 2)]
)
def test_pose_is_found_and_then_followed(
    tracker: Tracker, pose: tuple[float, float, float]
) -> None:
    tail = (0.3, -0.2, 0.1)
    first = seen(tracker.track(draw(discs_of_fish(*pose, tail)), 1.0))
    second = seen(
        tracker.track(draw(discs_of_fish(pose[0] - 0.01, pose[1], pose[2] + 0.05, tail)), 1.033)
    )
    assert first.whole_image
    assert not second.whole_image
    for found, (dx, turn) in ((first, (0.0, 0.0)), (second, (-0.01, 0.05))):
        assert found.head.x == pytest.approx(pose[0] + dx, abs=5e-4)
        assert found.head.y == pytest.approx(pose[1], abs=5e-4)
        assert found.head.heading == pytest.approx(pose[2] + turn, abs=0.006)
        assert found.tail == pytest.approx(tail, abs=0.08)
        assert found.spacing == pytest.approx(1.0, abs=0.01)


def test_an_empty_pool_has_no_front_marker(tracker: Tracker) -> None:
    assert reason(tracker.track(draw([]), 0.0)) == Reason.NO_FRONT


def test_a_head_with_one_marker_is_lost(tracker: Tracker) -> None:
    front, *others = discs_of_fish(0.0, 0.0, 0.0)
    assert reason(tracker.track(draw(others), 0.0)) == Reason.NO_FRONT
    assert reason(tracker.track(draw([front, *others[1:]]), 0.0)) == Reason.NO_REAR


def test_markers_that_are_too_far_apart_are_no_head(tracker: Tracker) -> None:
    discs = [(0.0, 0.0, 0.03, "front"), (0.2, 0.0, 0.03, "rear")]
    assert reason(tracker.track(draw(discs), 0.0)) == Reason.NO_PAIR


def test_swapped_markers_are_refused(tracker: Tracker) -> None:
    names = {"front": "rear", "rear": "front"}
    swapped = [(x, y, d, names.get(c, c)) for x, y, d, c in discs_of_fish(0.0, 0.0, 0.0)]
    assert reason(tracker.track(draw(swapped), 0.0)) == Reason.SWAPPED


def test_spots_of_the_wrong_size_are_not_markers(tracker: Tracker) -> None:
    fish = discs_of_fish(0.5, 0.2, 1.0)
    clutter = [(-1.0, 0.5, 0.1, "front"), (-1.0, 0.4, 0.008, "rear"), (1.5, -0.5, 0.06, "rear")]
    found = seen(tracker.track(draw(fish + clutter), 0.0))
    assert (found.head.x, found.head.y) == pytest.approx((0.5, 0.2), abs=5e-4)


def test_a_fish_that_is_elsewhere_at_once_is_another() -> None:
    tracker = Tracker(replace(CONFIG, rival_memory_s=2.0), calibration())
    near, far = draw(discs_of_fish(0.0, 0.0, 0.0)), draw(discs_of_fish(1.0, 0.5, 1.0))
    seen(tracker.track(near, 0.0))
    assert reason(tracker.track(far, 0.03)) == Reason.JUMP
    for stamp in (0.4, 0.8, 1.2, 1.6):
        assert reason(tracker.track(far, stamp)) in (Reason.JUMP, Reason.AMBIGUOUS)
    assert seen(tracker.track(far, 2.1)).head.x == pytest.approx(1.0, abs=5e-4)


def test_a_fish_that_was_out_of_sight_may_be_anywhere(tracker: Tracker) -> None:
    seen(tracker.track(draw(discs_of_fish(0.0, 0.0, 0.0)), 0.0))
    for stamp in (0.2, 0.4, 0.6):
        assert isinstance(tracker.track(draw([]), stamp), Lost)
    assert seen(tracker.track(draw(discs_of_fish(1.0, 0.5, 1.0)), 0.8)).head.x == pytest.approx(
        1.0, abs=5e-4
    )


def test_two_fish_of_the_same_look_give_no_pose_at_first(tracker: Tracker) -> None:
    both = draw(discs_of_fish(0.0, 0.0, 0.0) + discs_of_fish(0.6, 0.3, 2.0))
    assert reason(tracker.track(both, 0.0)) == Reason.AMBIGUOUS
    one = draw(discs_of_fish(0.0, 0.0, 0.0))
    for stamp in (0.1, 10.0, 20.0, 30.0):
        assert reason(tracker.track(one, stamp)) == Reason.AMBIGUOUS
    assert isinstance(tracker.track(one, 31.0), Detection)


def test_the_own_fish_is_followed_past_one_of_the_same_look(tracker: Tracker) -> None:
    """The other fish passes ours at a distance of 0.1 m, in the opposite direction."""
    seen(tracker.track(draw(discs_of_fish(-0.3, 0.0, 0.0)), 0.0))
    for k in range(1, 20):
        x = -0.3 + 0.03 * k
        both = draw(discs_of_fish(-x, 0.1, pi) + discs_of_fish(x, 0.0, 0.0))
        assert seen(tracker.track(both, k / 30)).head.x == pytest.approx(x, abs=5e-4)


def test_the_walls_image_of_the_own_fish_is_not_the_fish(tracker: Tracker) -> None:
    """The fish swims along the wall and its markers are hidden; its mirror image is as near as a fish can swim."""
    y, heading, wall = POOL[1] / 2 - 0.035, 0.1, POOL[1] / 2
    for k in range(5):
        seen(tracker.track(draw(discs_of_fish(0.01 * k, y, heading)), k / 30))
    image = draw(discs_of_fish(0.05, 2 * wall - y, -heading))
    assert reason(tracker.track(image, 5 / 30)) == Reason.MIRRORED
    again = seen(tracker.track(draw(discs_of_fish(0.06, y, heading)), 6 / 30))
    assert again.head.y == pytest.approx(y, abs=5e-4)


@pytest.mark.parametrize(("look_around_s", "taken_for_ours"), [(0.5, False), (1000.0, True)])
def test_a_fish_seen_before_ours_was_lost_is_not_ours_when_it_comes_back_first(
    look_around_s: float, taken_for_ours: bool
) -> None:
    """Both go out of sight. Without a look around the other one was never seen: it lies outside the followed part."""
    tracker = Tracker(replace(CONFIG, look_around_s=look_around_s), calibration())
    ours, other = discs_of_fish(0.0, 0.0, 0.0), discs_of_fish(0.9, 0.3, 2.0)
    seen(tracker.track(draw(ours), 0.0))
    for k in range(1, 10):
        seen(tracker.track(draw(ours + other), k / 10))
    for k in range(10, 18):
        assert isinstance(tracker.track(draw([]), k / 10), Lost)
    found = tracker.track(draw(discs_of_fish(0.3, 0.1, 2.0)), 1.9)
    assert isinstance(found, Detection) == taken_for_ours
    if not taken_for_ours:
        back = draw(discs_of_fish(0.33, 0.1, 2.0) + discs_of_fish(0.05, 0.0, 0.3))
        assert seen(tracker.track(back, 2.0)).head.x == pytest.approx(0.05, abs=5e-4)


@pytest.mark.parametrize("hidden_s", [0.2, 0.7, 3.0])
def test_while_ours_is_hidden_another_in_view_is_not_ours(
    tracker: Tracker, hidden_s: float
) -> None:
    ours = discs_of_fish(0.0, 0.0, 0.0)
    stamp = 0.0
    seen(tracker.track(draw(ours), stamp))
    while stamp < hidden_s:
        stamp += 0.05
        found = tracker.track(draw(discs_of_fish(0.6 - 0.1 * stamp, 0.3, 2.0)), stamp)
        assert isinstance(found, Lost)
    other = discs_of_fish(0.6 - 0.1 * stamp, 0.3, 2.0)
    found = seen(tracker.track(draw(ours + other), stamp + 0.05))
    assert found.head.x == pytest.approx(0.0, abs=5e-4)


def test_swapped_markers_with_the_tail_hidden_are_not_believed(tracker: Tracker) -> None:
    names = {"front": "rear", "rear": "front"}
    head = [(x, y, d, names[c]) for x, y, d, c in discs_of_fish(0.0, 0.0, 0.0)[:2]]
    assert reason(tracker.track(draw(head), 0.0)) == Reason.NO_TAIL


def test_once_known_the_fish_is_followed_with_its_tail_hidden(tracker: Tracker) -> None:
    seen(tracker.track(draw(discs_of_fish(0.0, 0.0, 0.0)), 0.0))
    found = seen(tracker.track(draw(discs_of_fish(0.005, 0.0, 0.0)[:2]), 0.033))
    assert found.tail is None
    assert found.head.x == pytest.approx(0.005, abs=5e-4)


def test_a_fish_with_its_tail_colours_in_another_order_is_another(tracker: Tracker) -> None:
    names = {"odd": "even", "even": "odd"}
    other = [(x, y, d, names.get(c, c)) for x, y, d, c in discs_of_fish(0.0, 0.0, 0.0)]
    assert reason(tracker.track(draw(other), 0.0)) == Reason.FOREIGN


def test_markers_a_tenth_nearer_to_each_other_are_another_fish(tracker: Tracker) -> None:
    front, rear, *tail = discs_of_fish(0.0, 0.0, 0.0)
    other = [(front[0] - 0.009, *front[1:]), rear, *tail]
    found = tracker.track(draw(other), 0.0)
    assert reason(found) == Reason.NO_PAIR
    assert found.spacing == pytest.approx(-0.1, abs=0.005)


@pytest.mark.parametrize("factor", [0.95, 1.05])
def test_a_wrong_focal_length_is_refused_and_measured(factor: float) -> None:
    """Poses would be 5 % of the distance from the middle off: 95 mm at x = 1.9 m."""
    width, height, model, k, d = lens_fields()
    k = [k[0] * factor, *k[1:4], k[4] * factor, *k[5:]]
    wrong = Calibration(Lens.from_camera_info(width, height, model, k, d), CONFIG.mount())
    found = Tracker(CONFIG, wrong).track(draw(discs_of_fish(1.5, 0.5, 1.0)), 0.0)
    assert reason(found) == Reason.NO_PAIR
    assert found.spacing == pytest.approx(1 / factor - 1, abs=0.01)


def test_toys_of_the_right_colours_beside_the_fish_are_not_taken_for_it(tracker: Tracker) -> None:
    toys = [(0.7, 0.3, 0.03, "front"), (0.79, 0.3, 0.03, "rear"), (0.0, 0.1, 0.03, "front")]
    fish = discs_of_fish(0.0, 0.0, 0.3)
    assert seen(tracker.track(draw(toys + fish), 0.0)).head.x == pytest.approx(0.0, abs=5e-4)
    assert isinstance(tracker.track(draw(toys), 0.03), Lost)
    assert isinstance(tracker.track(draw(toys), 1.0), Lost)


def test_a_mirror_image_in_the_wall_is_not_the_fish(tracker: Tracker) -> None:
    """The wall stands at y = 1.065 m."""
    ours = discs_of_fish(0.4, 1.02, 0.3)
    image = [(x, 2.13 - y, d, c) for x, y, d, c in ours]
    assert seen(tracker.track(draw(ours + image), 0.0)).head.y == pytest.approx(1.02, abs=5e-4)
    assert isinstance(tracker.track(draw(image), 0.03), Lost)


@pytest.mark.parametrize(
    ("pose", "believed"),
    [
        ((0.16, 0.0, 3.0), True),
        ((0.0, -0.2, 3.0), False),  # more than 1.5 m/s and 30 mm
        ((0.0, 0.0, 3.0 + 1.6), True),  # across +-pi
        ((0.0, 0.0, 3.0 - 2.0), False),  # more than 15 rad/s and 0.3 rad
    ],
)
def test_a_fish_is_followed_as_fast_as_it_may_be_and_no_faster(
    tracker: Tracker, pose: tuple[float, float, float], believed: bool
) -> None:
    seen(tracker.track(draw(discs_of_fish(0.0, 0.0, 3.0)), 5.0))
    found = tracker.track(draw(discs_of_fish(*pose)), 5.1)
    assert isinstance(found, Detection) if believed else reason(found) == Reason.JUMP


def test_a_flip_is_a_jump(tracker: Tracker) -> None:
    seen(tracker.track(draw(discs_of_fish(0.0, 0.0, 0.0)), 0.0))
    assert reason(tracker.track(draw(discs_of_fish(0.0, 0.0, pi)), 0.03)) == Reason.JUMP


def test_a_stamp_that_goes_back_starts_again(tracker: Tracker) -> None:
    seen(tracker.track(draw(discs_of_fish(0.0, 0.0, 0.0)), 100.0))
    assert seen(tracker.track(draw(discs_of_fish(1.0, 0.5, 1.0)), 3.0)).whole_image


def test_without_a_tail_marker_the_head_is_still_found(tracker: Tracker) -> None:
    discs = [d for d in discs_of_fish(0.3, 0.3, 2.0) if d[3] != "even"]
    found = seen(tracker.track(draw(discs), 0.0))
    assert found.tail is None
    assert found.head.heading == pytest.approx(2.0, abs=0.006)


def test_a_fish_without_marked_tail() -> None:
    tracker = Tracker(replace(CONFIG, tail_links=0), calibration())
    assert seen(tracker.track(draw(discs_of_fish(0.3, 0.3, 2.0, ())), 0.0)).tail is None


@pytest.mark.parametrize("edge", [0.045, 0.043, 0.050])
def test_the_rim_gives_the_middle_of_a_half_hidden_marker(tracker: Tracker, edge: float) -> None:
    """A white board over the front marker, whose middle is 0.045 m ahead, from `edge` on."""
    picture = draw(discs_of_fish(0.0, 0.0, 0.0))
    seen(tracker.track(picture, 0.0))
    picture[:, 640 + round(SCALE * edge) :] = 255
    half = seen(tracker.track(picture, 0.033))
    assert half.head.x == pytest.approx(0.0, abs=6e-4)
    assert abs(half.head.heading) < 4.0 * np.sqrt(half.head.covariance[2, 2])
    assert half.head.heading == pytest.approx(0.0, abs=0.02)


def test_a_pose_outside_the_pool_is_refused() -> None:
    tracker = Tracker(replace(CONFIG, pool_margin=0.0), calibration())
    assert reason(tracker.track(draw(discs_of_fish(0.0, 1.1, 0.0)), 0.0)) == Reason.OUTSIDE


def test_pictures_of_noise_give_reasons_not_errors(tracker: Tracker) -> None:
    random = np.random.default_rng(5)
    for k in range(5):
        noise = random.integers(0, 256, (SIZE[1], SIZE[0], 3)).astype(np.uint8)
        assert isinstance(tracker.track(noise, 0.03 * k), Lost)


def changed(drawn: np.ndarray, picture: np.ndarray, x: float, y: float) -> bool:
    """Whether something was drawn within 2 pixels of a place in the pool, m."""
    u, v = round(640.0 + SCALE * x), round(360.0 - SCALE * y)
    part = np.s_[v - 2 : v + 3, u - 2 : u + 3]
    return bool(np.any(drawn[part] != picture[part]))


def test_the_annotated_picture_points_where_the_fish_looks_and_follows_its_tail(
    tracker: Tracker,
) -> None:
    discs = discs_of_fish(0.3, 0.3, 2.0, (0.4, -0.2, 0.3))
    picture = draw(discs)
    before = picture.copy()
    found = seen(tracker.track(picture, 0.0))
    drawn = annotated(picture, found, CONFIG, calibration())
    np.testing.assert_array_equal(picture, before)
    along = np.array([cos(2.0), sin(2.0)])
    assert changed(drawn, picture, *(0.3 + 0.2 * along))
    assert not changed(drawn, picture, *(0.3 - 0.2 * along))
    assert all(
        changed(drawn, picture, x, y) for x in (-1.5, 1.5) for y in (-1.065, 1.065)
    )  # the walls
    links = tail_points(found, CONFIG)[2:]  # after centre of mass and hinge
    np.testing.assert_allclose(links, [disc[:2] for disc in discs[2:]], atol=2e-3)


def test_the_annotated_picture_says_why_there_is_no_pose(tracker: Tracker) -> None:
    picture = draw([])
    drawn = annotated(picture, tracker.track(picture, 0.0), CONFIG, calibration())
    text = drawn[:34].astype(int)
    assert np.any(text[..., 2] - text[..., 1] > 150)  # in red


def cast(picture: np.ndarray, red: float, blue: float, level: float = 1.0) -> np.ndarray:
    """The picture under a light with these gains."""
    return np.clip(picture * np.array([blue, 1.0, red]) * level, 0, 255).astype(np.uint8)


@pytest.mark.parametrize(("red", "blue"), [(1.25, 0.65), (1.3, 0.6), (0.7, 1.3)])
def test_a_light_of_another_colour_is_found_within_a_second(
    tracker: Tracker, red: float, blue: float
) -> None:
    picture = cast(draw(discs_of_fish(0.3, 0.2, 1.0, (0.2, 0.1, 0.0))), red, blue)
    found = [tracker.track(picture, k / 30) for k in range(30)]
    assert all(isinstance(f, Detection) for f in found[20:])
    assert seen(found[-1]).head.x == pytest.approx(0.3, abs=1e-3)


def test_colours_follow_a_light_that_turns_warm_and_dark(tracker: Tracker) -> None:
    picture = draw(discs_of_fish(0.3, 0.2, 1.0))
    for k in range(240):
        warm = k / 240
        light = cast(picture, 1.0 + 0.3 * warm, 1.0 - 0.5 * warm, 1.0 - 0.5 * warm)
        seen(tracker.track(light, k / 30))
    assert tracker.hue_shifts["rear"] > 5.0


def test_colours_go_no_further_than_they_may() -> None:
    config = replace(CONFIG, hue_shift_max=4)
    tracker = Tracker(config, calibration())
    picture = draw(discs_of_fish(0.3, 0.2, 1.0))
    for k in range(240):
        tracker.track(cast(picture, 1.0 + 0.5 * k / 240, 1.0 - 0.6 * k / 240), k / 30)
    assert max(map(abs, tracker.hue_shifts.values())) <= 4.0


def test_another_light_is_not_found_in_toys(tracker: Tracker) -> None:
    """A head without a tail teaches no colours."""
    picture = cast(draw(discs_of_fish(0.3, 0.2, 1.0)[:2]), 1.25, 0.65)
    assert all(isinstance(tracker.track(picture, k / 30), Lost) for k in range(30))
    assert set(tracker.hue_shifts.values()) == {0.0}


def test_two_fish_of_ours_are_told_apart_by_their_colours() -> None:
    """One tracker each; the second fish has a blue front and an orange rear marker."""
    first = Tracker(CONFIG, calibration())
    second = Tracker(
        replace(CONFIG, front_colour=(108, 120, 150, 90), rear_colour=(10, 19, 110, 90)),
        calibration(),
    )
    names = {"front": "blue", "rear": "orange"}
    for k in range(20):  # they pass each other 0.1 m apart
        x = 0.03 * (k - 10)
        other = discs_of_fish(-x, 0.1, pi)
        both = discs_of_fish(x, 0.0, 0.0) + [(*d[:3], names.get(d[3], d[3])) for d in other]
        picture = draw(both)
        assert seen(first.track(picture, k / 30)).head.x == pytest.approx(x, abs=5e-4)
        assert seen(second.track(picture, k / 30)).head.x == pytest.approx(-x, abs=5e-4)


def test_errors_of_partly_hidden_markers_are_as_large_as_the_covariance_says() -> None:
    """A bar hides a part of the front marker, and JPEG smears the colours over its edge."""
    nees = []
    for k in range(40):
        heading, x = 0.3 * k, 0.5 + 0.0007 * k
        picture = draw(discs_of_fish(x, 0.2, heading), seed=k)
        u = float(calibration().pool_to_pixel([[x + 0.045 * np.cos(heading), 0.2]])[0, 0])
        left = round(u + 4.0 * np.sin(1.7 * k))
        picture[:, left : left + 5] = BODY
        _, sent = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, 90])
        found = Tracker(CONFIG, calibration()).track(cv2.imdecode(sent, cv2.IMREAD_COLOR), 0.0)
        if isinstance(found, Detection):
            head = found.head
            error = np.array([head.x - x, head.y - 0.2, wrap(head.heading - heading)])
            nees.append(error @ np.linalg.solve(head.covariance, error))
    assert len(nees) > 15
    assert np.median(nees) < 5.0  # 2.4 where the covariance is right


def detection(
    t: float, x: float, heading: float = 0.0, tail: tuple[float, ...] | None = None
) -> Detection:
    head = HeadPose(x, -x, (heading + pi) % (2 * pi) - pi, np.eye(3))
    return Detection(t, head, tail, 1.0, (0, 0, 1, 1), False)


def test_off_gives_every_pose_back() -> None:
    found = detection(3.0, 0.1)
    assert PoseLowPass(0.0, 0.5).filtered(found) is found


def test_steady_motion_is_right_at_its_stamp_with_irregular_frames() -> None:
    rng, lowpass, t = np.random.default_rng(0), PoseLowPass(CUTOFF, 0.5), 100.0
    for _ in range(200):
        t += rng.uniform(0.01, 0.08)
        out = lowpass.filtered(detection(t, 0.3 * t, 0.9 * t, (0.2 * t, -0.1 * t)))
        assert out.head.x == pytest.approx(0.3 * out.stamp, abs=1e-9)
        assert sin(out.head.heading - 0.9 * out.stamp) == pytest.approx(0.0, abs=1e-9)
        assert cos(out.head.heading - 0.9 * out.stamp) > 0
        assert out.tail == pytest.approx((0.2 * out.stamp, -0.1 * out.stamp), abs=1e-9)
        assert -pi <= out.head.heading < pi
    assert t - out.stamp == pytest.approx(1 / (2 * pi * CUTOFF), rel=0.5)


def test_delay_is_the_time_constant_less_half_a_frame() -> None:
    lowpass = PoseLowPass(CUTOFF, 0.5)
    times = np.arange(400) / RATE
    delays = [t - lowpass.filtered(detection(t, 0.0)).stamp for t in times]
    assert delays[0] == 0.0
    assert delays[-1] == pytest.approx(1 / (2 * pi * CUTOFF) - 0.5 / RATE, abs=1e-4)


@pytest.mark.parametrize(
    ("frequency", "gain"), [(0.05, 1.0), (CUTOFF, 1 / sqrt(2)), (10 * CUTOFF, 0.1)]
)
def test_gain_is_that_of_a_first_order_filter(frequency: float, gain: float) -> None:
    lowpass, times = PoseLowPass(CUTOFF, 0.5), np.arange(0.0, 20.0 / frequency, 0.02 / frequency)
    times = times if times[1] < 1 / RATE else np.arange(0.0, 3.0 / frequency, 1 / RATE)
    out = [lowpass.filtered(detection(t, sin(2 * pi * frequency * t))).head.x for t in times]
    last = out[len(out) // 2 :]
    assert (max(last) - min(last)) / 2 == pytest.approx(gain, rel=0.05)


def test_it_starts_again_after_a_gap_or_a_clock_that_jumps_back() -> None:
    lowpass = PoseLowPass(CUTOFF, 0.5)
    for k in range(50):
        lowpass.filtered(detection(k / RATE, 0.0))
    after_gap = lowpass.filtered(detection(5.0, 1.0))
    assert (after_gap.stamp, after_gap.head.x) == (5.0, 1.0)
    back = lowpass.filtered(detection(1.0, 2.0))
    assert (back.stamp, back.head.x) == (1.0, 2.0)


def test_a_tail_that_comes_back_waits_until_its_time_is_the_head_s() -> None:
    lowpass = PoseLowPass(CUTOFF, 0.5)
    for k in range(200):
        lowpass.filtered(detection(k / RATE, 0.0))
    out = [lowpass.filtered(detection(k / RATE, 0.0, 0.0, (0.1,))) for k in range(200, 400)]
    assert out[0].tail is None
    assert out[-1].tail == pytest.approx((0.1,))
    waited = next(k for k, found in enumerate(out) if found.tail is not None) / RATE
    assert waited == pytest.approx(3 / (2 * pi * CUTOFF), rel=0.1)


def of_spacing(spacing: float, whole_image: bool = False) -> Detection:
    return Detection(
        0.0, HeadPose(0.0, 0.0, 0.0, np.eye(3)), None, spacing, (0, 0, 1, 1), whole_image
    )


def test_results_and_refusals_are_counted_by_kind() -> None:
    statistics = Statistics()
    assert statistics.values() == {"tracked": "0", "from_whole_image": "0"}
    statistics.add(of_spacing(1.0, whole_image=True), 0.004, 0.06)
    statistics.add(Lost(0.0, Reason.JUMP), 0.006, 0.06)
    statistics.refuse("bad image", "JPEG cut off")
    values = statistics.values()
    assert statistics.images == 2
    assert values["tracked"] == values["from_whole_image"] == "1"
    assert values["refused: bad image"] == "1"
    assert statistics.last_error == "JPEG cut off"
    assert statistics.last_reason == Reason.JUMP.value
    assert values[f"lost: {Reason.JUMP.value}"] == "1"
    assert float(values["processing_ms_p50"]) == pytest.approx(5.0)
    assert float(values["stamp_to_pose_ms_p99"]) == pytest.approx(60.0)


@pytest.mark.parametrize(
    ("spacing", "wrong"), [(1.0, False), (1.014, False), (1.016, True), (0.984, True)]
)
def test_a_wrong_marker_spacing_shows_after_enough_poses(spacing: float, wrong: bool) -> None:
    statistics = Statistics()
    for _ in range(SPACINGS - 1):
        statistics.add(of_spacing(spacing), 0.0, 0.0)
    assert statistics.spacing_error() is None
    statistics.add(of_spacing(spacing), 0.0, 0.0)
    assert statistics.spacing_error() == (pytest.approx(spacing - 1.0) if wrong else None)


def test_images_refused_for_one_scale_say_so() -> None:
    statistics = Statistics()
    for _ in range(SPACINGS):
        statistics.add(Lost(0.0, Reason.NO_PAIR, 0.05), 0.0, 0.0)
    assert statistics.refused_spacing() == pytest.approx(0.05)
    statistics.add(of_spacing(1.0), 0.0, 0.0)
    assert statistics.refused_spacing() is None


def test_images_refused_for_many_spacings_show_no_scale() -> None:
    statistics = Statistics()
    for k in range(SPACINGS):
        statistics.add(Lost(0.0, Reason.NO_PAIR, 0.1 if k % 2 else -0.1), 0.0, 0.0)
    assert statistics.refused_spacing() is None
