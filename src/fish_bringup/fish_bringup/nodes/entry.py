# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Entry points of the installed executables."""

from functools import partial

from fish_node.entry import start

live_view = partial(start, "fish_bringup", "live_view")
