# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Parameters of the tracker."""

from dataclasses import dataclass
from math import isfinite
from pathlib import Path

from fish_node.frames import require_frame, require_frame_prefix
from fish_node.parameter_file import read_settings
from fish_vision.calibration import Calibration, Lens, Mount
from fish_vision.pose import MarkerLayout
from fish_vision.segmentation import HUES, ColourRange
from fish_vision.tags import FINDS_TAGS, tags_in

NODE = "/fish/tracker"
KINDS = ("colours", "tags")


@dataclass(frozen=True)
class TrackerConfig:
    """ROS parameters of the tracker node; tuples because ROS parameters are lists.

    Colours are [hue low, hue high, least saturation, least value]: hue 0 to 179 (half degrees; low > high
    wraps through red), the others 0 to 255.
    """

    frame_id: str = "pool"  # of the published poses
    use_raw: bool = False  # take camera/image_raw instead of camera/image_raw/compressed
    debug_image: bool = False  # publish camera/debug/compressed, the annotated picture
    camera_position: tuple[float, ...] = (0.05, -0.08, 3.2)  # optical centre in the pool frame, m
    camera_tilt: tuple[float, ...] = (
        -0.022,
        0.018,
        0.010,
    )  # about the optical axes, rad; 0 = straight down
    focal_scale: float = 1.0  # corrects the focal length of camera_info by this factor, where the diagnostics ask for it
    marker_height: float = 0.0  # of the markers above the pool frame's origin, m
    marker_kind: str = "colours"  # colours: four kinds of coloured discs; tags: coded squares
    front_colour: tuple[int, ...] = (20, 36, 110, 90)  # yellow
    rear_colour: tuple[int, ...] = (136, 166, 90, 80)  # magenta
    tail_odd_colour: tuple[int, ...] = (172, 12, 110, 80)  # red: links 1, 3, ...
    tail_even_colour: tuple[int, ...] = (46, 76, 90, 70)  # green: links 2, 4, ...
    hue_shift_max: int = (
        20  # by which the light may shift a colour's hues, half degrees; 0 = ranges stay as given
    )
    front_marker: tuple[float, ...] = (0.045, 0.0)  # base_link x, y, m
    rear_marker: tuple[float, ...] = (-0.045, 0.0)  # base_link x, y, m
    marker_diameter: float = 0.030  # of the head's markers, m
    tail_marker_diameter: float = 0.016  # m
    tail_links: int = 3  # marked links; 0 = no tail markers
    tag_dictionary: str = (
        "4X4_50"  # OpenCV's name of the tags' family without DICT_, such as APRILTAG_36h11
    )
    head_tag: int = 0  # number of the head's tag
    tag_size: float = 0.05  # side of the head's black square, m
    head_tag_pose: tuple[float, ...] = (
        0.0,
        0.0,
        0.0,
    )  # base_link x, y, m, and turn of its picture's right to base_link x, rad
    first_tail_tag: int = 1  # number of the first link's tag, its picture's right ahead; the next links have the next numbers
    tail_tag_size: float = 0.03  # side of a tail tag's black square, m
    corner_std: float = 0.1  # standard deviation of a tag's corner, pixels
    hinge_offset: float = 0.075  # head's centre of mass to the tail's hinge, m
    link_length: float = 0.07 / 3  # hinge to the marker at the far end of a link, m
    area_min: float = 0.35  # least area of a blob, share of the marker's
    area_max: float = 1.6  # greatest area of a blob of the head's colours, share of the marker's
    tail_area_max: float = (
        2.5  # and of the tail's: of few pixels, whose rim counts much, share of the marker's
    )
    spacing_tolerance: float = (
        0.03  # misfit of the head markers' distance beyond its uncertainty, share
    )
    tail_tolerance: float = 0.008  # misfit of a tail marker's distance from its hinge, m
    roi_radius: float = 0.25  # half side of the part of the image searched around the last pose, m
    max_speed: float = 1.5  # m/s, faster is a jump
    max_yaw_rate: float = 15.0  # rad/s, faster is a jump
    reacquire_s: float = 0.5  # after so long without a pose the fish may be anywhere, s
    rival_memory_s: float = (
        30.0  # a fish seen elsewhere while ours was in view or just lost is not ours for so long, s
    )
    look_around_s: float = (
        1.0  # while the fish is followed the whole image is searched so often for other fish, s
    )
    pixel_std: float = 0.06  # standard deviation of a whole marker's middle, pixels
    lowpass_hz: float = 0.0  # cutoff of a low-pass over pose and tail, Hz; 0 = off.
    # It delays by 1 / (2 pi lowpass_hz), and the stamps are earlier by as much
    pool_margin: float = 0.10  # a pose so far outside the walls is refused, m
    camera_frame: str = "overhead_optical"  # of the camera; its place goes to /tf_static
    frame_prefix: str = ""  # before every frame but the pool's, such as fish_2/ for a second fish

    def __post_init__(self) -> None:
        for name, count in _LISTS:
            value = getattr(self, name)
            if len(value) != count or not all(isfinite(v) for v in value):
                raise ValueError(f"{name} = {list(value)}: expected {count} finite numbers")
        require_frame("frame_id", self.frame_id)
        require_frame("camera_frame", self.camera_frame)
        require_frame_prefix(self.frame_prefix)
        for name, low, high in _RANGES:
            value = getattr(self, name)
            if not low <= value <= high:
                raise ValueError(f"{name} = {value}: expected {low} to {high}")
        for name in ("front_colour", "rear_colour", "tail_odd_colour", "tail_even_colour"):
            value = getattr(self, name)
            if not (
                all(0 <= h < HUES for h in value[:2]) and all(0 <= v <= 255 for v in value[2:])
            ):
                raise ValueError(
                    f"{name} = {list(value)}: expected two hues 0 to 179 and two levels 0 to 255"
                )
        if self.marker_kind not in KINDS:
            raise ValueError(f"marker_kind = {self.marker_kind!r}: expected {' or '.join(KINDS)}")
        if FINDS_TAGS or self.marker_kind == "tags":
            self._check_tags()
        if self.layout().spacing < self.marker_diameter:
            raise ValueError(
                f"front_marker = {list(self.front_marker)}, rear_marker = {list(self.rear_marker)}: "
                f"expected to be more than marker_diameter = {self.marker_diameter} m apart"
            )

    def _check_tags(self) -> None:
        """Dictionary and numbers."""
        try:
            count = tags_in(self.tag_dictionary)
        except ValueError as error:
            raise ValueError(f"tag_dictionary: {error}") from error
        if not 0 <= self.head_tag < count:
            raise ValueError(
                f"head_tag = {self.head_tag}: expected 0 to {count - 1}, as tag_dictionary {self.tag_dictionary} has"
            )
        last = self.first_tail_tag + self.tail_links
        if not 0 <= self.first_tail_tag <= last <= count:
            raise ValueError(
                f"first_tail_tag = {self.first_tail_tag}: expected 0 to {count - self.tail_links}, as tag_dictionary "
                f"{self.tag_dictionary} has {count} tags and the tail {self.tail_links}"
            )
        if self.first_tail_tag <= self.head_tag < last:
            raise ValueError(
                f"head_tag = {self.head_tag}: expected another number than the tail's, {self.first_tail_tag} to {last - 1}"
            )

    def mount(self) -> Mount:
        """Where the camera hangs."""
        return Mount(self.camera_position, self.camera_tilt)

    def calibration(self, lens: Lens) -> Calibration:
        """The map from pixels to the markers' plane; CalibrationError if lens and mount do not belong together."""
        return Calibration(lens.scaled(self.focal_scale), self.mount(), self.marker_height)

    def layout(self) -> MarkerLayout:
        """Where the markers sit on the fish."""
        return MarkerLayout(
            tuple(self.front_marker), tuple(self.rear_marker), self.hinge_offset, self.link_length
        )

    def colour(self, marker: str) -> ColourRange:
        """The range of marker `front`, `rear`, `tail_odd` or `tail_even`."""
        return ColourRange(*getattr(self, f"{marker}_colour"))


def config_from_file(path: Path) -> TrackerConfig:
    """Parameters from a ROS params file, as the node reads it.

    Raises:
        ValueError: not such a file, an unknown parameter, or a value of the wrong type or out of range; names the file.
    """
    return read_settings(path, NODE, TrackerConfig, _refuse)


def _refuse(text: str) -> None:
    raise ValueError(text)


_LISTS = (
    ("camera_position", 3),
    ("camera_tilt", 3),
    ("front_colour", 4),
    ("rear_colour", 4),
    ("tail_odd_colour", 4),
    ("tail_even_colour", 4),
    ("front_marker", 2),
    ("rear_marker", 2),
    ("head_tag_pose", 3),
)
_RANGES = (  # field, lowest, highest
    ("focal_scale", 0.5, 2.0),
    ("marker_height", -1.0, 1.0),
    ("hue_shift_max", 0, 30),
    ("marker_diameter", 0.002, 0.5),
    ("tail_marker_diameter", 0.002, 0.5),
    ("tail_links", 0, 10),
    ("tag_size", 0.005, 0.5),
    ("tail_tag_size", 0.005, 0.5),
    ("corner_std", 0.001, 5.0),
    ("hinge_offset", 0.0, 1.0),
    ("link_length", 0.002, 1.0),
    ("area_min", 0.01, 1.0),
    ("area_max", 1.0, 100.0),
    ("tail_area_max", 1.0, 100.0),
    ("spacing_tolerance", 0.01, 0.5),
    ("tail_tolerance", 0.0005, 0.1),
    ("roi_radius", 0.05, 5.0),
    ("max_speed", 0.01, 20.0),
    ("max_yaw_rate", 0.1, 200.0),
    ("reacquire_s", 0.0, 10.0),
    ("rival_memory_s", 0.0, 3600.0),
    ("look_around_s", 0.0, 3600.0),
    ("pixel_std", 0.001, 5.0),
    ("lowpass_hz", 0.0, 1000.0),
    ("pool_margin", 0.0, 5.0),
)
