"""Entry points of the installed executables."""

from functools import partial

from fish_node.entry import start

tracker = partial(start, "fish_vision", "tracker")
