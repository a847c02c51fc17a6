# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Parameters of the camera node: the camera, the picture it takes, and the fish that it sees."""

from dataclasses import dataclass
from math import isfinite

from fish_node.frames import require_frame, require_frame_prefix
from fish_sim.camera.fish import FishShape
from fish_sim.camera.model import CameraModel
from fish_sim.camera.renderer import Look


@dataclass(frozen=True)
class CameraConfig:
    """ROS parameters of the camera node; lists because ROS parameters are lists."""

    width: int = 1280  # pixels
    height: int = 720  # pixels
    rate_hz: float = 30.0  # frames per second
    focal: tuple[float, ...] = (1000.0, 1000.0)  # fx, fy, pixels
    centre: tuple[float, ...] = (634.0, 366.0)  # cx, cy, pixels
    distortion: tuple[float, ...] = (
        -0.26,
        0.07,
        0.0008,
        -0.0005,
        0.0,
    )  # k1 k2 p1 p2 k3, a wide-angle webcam
    camera_position: tuple[float, ...] = (0.05, -0.08, 3.2)  # optical centre in the pool frame, m
    camera_tilt: tuple[float, ...] = (
        -0.022,
        0.018,
        0.010,
    )  # about the optical axes, rad; 0 = straight down
    frame_id: str = "overhead_optical"  # of image and camera_info headers
    latency_s: float = 0.05  # from exposure to publication, s
    drop_rate: float = 0.01  # probability that a frame is lost
    exposure_s: float = 0.004  # shutter time, s; 0 = no motion blur
    noise_std: float = 3.0  # sensor noise, grey levels
    glare: float = 1.0  # strength of lamp reflections; 0 = none
    jpeg_quality: int = 90  # 1 to 100
    publish_raw: bool = False  # also camera/image_raw, 2.8 MB a frame
    seed: int = 1  # of noise, water and lost frames
    hinge_offset: float = 0.075  # head's centre of mass to the tail's hinge, m
    link_length: float = 0.07 / 3  # of one tail link, m
    fin_length: float = 0.03  # m
    tail_links: int = 3  # marked tail links
    frame_prefix: str = ""  # before every frame but the pool's, such as fish_2/ for a second fish

    def __post_init__(self) -> None:
        for name, count in (
            ("focal", 2),
            ("centre", 2),
            ("distortion", 5),
            ("camera_position", 3),
            ("camera_tilt", 3),
        ):
            value = getattr(self, name)
            if len(value) != count or not all(isfinite(v) for v in value):
                raise ValueError(f"{name} = {list(value)}: expected {count} finite numbers")
        require_frame("frame_id", self.frame_id)
        require_frame_prefix(self.frame_prefix)
        for name, low, high in _RANGES:
            value = getattr(self, name)
            if not low <= value <= high:
                raise ValueError(f"{name} = {value}: expected {low} to {high}")
        if min(self.focal) <= 0.0 or self.camera_position[2] <= 0.1:
            raise ValueError(
                f"focal = {list(self.focal)}, camera_position = {list(self.camera_position)}: "
                "expected positive focal lengths and a camera more than 0.1 m above the water"
            )

    def model(self) -> CameraModel:
        """The geometry of this camera."""
        return CameraModel(
            (self.width, self.height),
            self.focal,
            self.centre,
            self.distortion,
            self.camera_position,
            self.camera_tilt,
        )

    def shape(self) -> FishShape:
        """The fish that the camera sees."""
        return FishShape(
            hinge_offset=self.hinge_offset,
            link_length=self.link_length,
            fin_length=self.fin_length,
            links=self.tail_links,
        )

    def look(self) -> Look:
        """Noise, glare and compression of the picture."""
        return Look(
            noise_std=self.noise_std,
            glare=self.glare,
            jpeg_quality=self.jpeg_quality,
            seed=self.seed,
        )


_RANGES = (  # field, lowest, highest
    ("width", 64, 7680),
    ("height", 64, 4320),
    ("rate_hz", 0.1, 240.0),
    ("latency_s", 0.0, 1.0),
    ("drop_rate", 0.0, 1.0),
    ("exposure_s", 0.0, 0.1),
    ("noise_std", 0.0, 50.0),
    ("glare", 0.0, 3.0),
    ("jpeg_quality", 1, 100),
    ("seed", 0, 2**31 - 1),
    ("hinge_offset", 0.01, 1.0),
    ("link_length", 0.005, 1.0),
    ("fin_length", 0.0, 1.0),
    ("tail_links", 1, 10),
)
