# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Entry points of the installed executables."""

from functools import partial

from fish_node.entry import start

fusion = partial(start, "fish_control", "fusion")
planner = partial(start, "fish_control", "planner")
controller = partial(start, "fish_control", "controller")
pilot = partial(start, "fish_control", "pilot")
exciter = partial(start, "fish_control", "exciter")
