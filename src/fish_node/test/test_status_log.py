# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What a node says of itself, once on the console."""

from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.logging import get_logger

from fish_node.nodes.status_log import QUIET_S, StatusLog

OK, WARN, ERROR = DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR


class Console:
    """Stands for a logger and for the clock."""

    def __init__(self):
        self.time, self.said = 0.0, []
        self.log = StatusLog(self, lambda: self.time)

    def info(self, text):
        self.said.append(("info", text))

    def warning(self, text):
        self.said.append(("warning", text))

    def error(self, text):
        self.said.append(("error", text))

    def hear(self, seconds, *statuses):
        """A status each second, in turns."""
        for second in range(seconds):
            self.log.say(*statuses[second % len(statuses)])
            self.time += 1.0


def test_each_change_is_said_once_and_other_numbers_are_no_change():
    console = Console()
    for rate in range(20):
        console.hear(1, (WARN, f"running at {0.5 + rate / 100}, -{rate} s behind"))
    console.hear(5, (ERROR, "camera lost"))
    console.hear(5, (OK, "estimating"))
    assert console.said == [
        ("warning", "running at 0.5, -0 s behind"),
        ("error", "camera lost"),
        ("info", "estimating"),
    ]


def test_what_comes_and_goes_fills_no_log_and_the_last_word_holds():
    console = Console()
    seconds = round(10 * QUIET_S)
    console.hear(seconds, (WARN, "no image"), (OK, "running"))
    assert 2 < len(console.said) <= 2 * seconds / QUIET_S
    console.hear(round(QUIET_S) + 1, (WARN, "no image"))
    assert console.said[-1] == ("warning", "no image")


def test_one_logger_takes_every_level(capfd):
    """rclpy refuses two levels from one line of code."""
    log = StatusLog(get_logger("status_log"))
    for level in (OK, WARN, ERROR, OK):
        log.say(level, f"level {level!r}")
    said = "".join(capfd.readouterr())
    assert [word for word in ("[INFO]", "[WARN]", "[ERROR]") if word in said] == [
        "[INFO]",
        "[WARN]",
        "[ERROR]",
    ]
