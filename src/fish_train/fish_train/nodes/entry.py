"""Entry points of the installed executables."""

from functools import partial

from fish_node.entry import start

recorder = partial(start, "fish_train", "recorder")
replayer = partial(start, "fish_train", "replayer")
