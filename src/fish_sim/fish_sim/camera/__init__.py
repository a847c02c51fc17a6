# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The overhead camera: geometry, picture, timing of its frames. Pure; the node is fish_sim.nodes.camera."""

from fish_sim.camera.config import CameraConfig as CameraConfig
from fish_sim.camera.fish import FishPose as FishPose
from fish_sim.camera.fish import FishShape as FishShape
from fish_sim.camera.fish import Patch as Patch
from fish_sim.camera.fish import patches as patches
from fish_sim.camera.model import CameraModel as CameraModel
from fish_sim.camera.renderer import Look as Look
from fish_sim.camera.renderer import PoolRenderer as PoolRenderer
