# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Entry points of the installed executables."""

from functools import partial

from fish_node.entry import start

tracker = partial(start, "fish_vision", "tracker")
