"""The verbs of `fish_train`, for the command line and for the installed executables.

Each is a module of this folder with `add_arguments(parser)` and `run(args) -> int` (exit status). A new
verb is one file and one line here; setup.py reads this table, so that `ros2 run fish_train VERB` works as
well. Nothing is imported here.
"""

VERBS = {
    "demo": "the whole robot: swim a path, record, score, show",
    "score": "tracking errors of a recorded run, and its page",
    "inspect": "print and plot what is in a recording",
    "recover": "mend a truncated recording and say what was lost",
    "import_pool": "convert the real robot's ROS 1 bags to recordings in the project's format",
    "identify": "fit the robot's parameters to recordings, with standard errors and a page",
    "diagnose": "say which physics the model lacks, where, and how sure that is",
    "excite": "swim the experiment that a diagnosis proposes, or your own program, and record it",
    "prove": "blind study: hidden effects, sealed labels, how often the diagnosis is right",
    "predict": "simulate forward from a recording's states and compare",
    "coverage": "how often identification's intervals hold the truth, on synthetic recordings",
    "train": "learn the gains through the simulator",
    "evaluate": "how well gains follow paths on a plant",
    "paper": "remake the figures and the table of the paper",
    "weights": "show what is in a weights file",
}
