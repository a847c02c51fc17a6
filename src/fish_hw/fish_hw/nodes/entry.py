# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Entry points of the installed executables."""

from functools import partial

from fish_node.entry import start

rotor = partial(start, "fish_hw", "rotor")
rudder = partial(start, "fish_hw", "rudder")
imu = partial(start, "fish_hw", "imu")
camera = partial(start, "fish_hw", "camera")
fake_robot = partial(start, "fish_hw", "fake_robot")
