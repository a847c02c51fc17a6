# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Entry points of the installed executables."""

from functools import partial

from fish_node.entry import start

simulator = partial(start, "fish_sim", "simulator")
camera = partial(start, "fish_sim", "camera")
