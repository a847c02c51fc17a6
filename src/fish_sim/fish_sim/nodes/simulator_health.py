# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The simulator's state as a level and a line of /diagnostics."""

from __future__ import annotations

from diagnostic_msgs.msg import DiagnosticStatus

SLOW = 0.95  # share of the asked pace below which the node says that it lags


def health(
    divergences: int,
    refusal: str,
    paused: bool,
    lost: float,
    awaited: str,
    pace: float,
    asked: float,
    disarmed: str,
) -> tuple[bytes, str]:
    """(level, text), the worst news first.

    refusal: why the last command was refused; lost: s of real time that were skipped; awaited: what lockstep waits for; pace,
    asked: simulated seconds in a second; disarmed: the reason. A text is empty where there is nothing to say.
    """
    if divergences:
        return DiagnosticStatus.ERROR, f"the motion diverged {divergences} times"
    if refusal:
        return DiagnosticStatus.WARN, f"joint_command refused: {refusal}"
    if paused:
        return DiagnosticStatus.OK, "paused"
    if lost > 0.0:
        return DiagnosticStatus.WARN, f"behind real time, {lost:.2f} s skipped in the last second"
    if awaited:
        return DiagnosticStatus.WARN, f"waits for {awaited}"
    if pace < SLOW * asked:
        return DiagnosticStatus.WARN, f"behind real time, running at {pace:.2f}"
    if disarmed:
        return DiagnosticStatus.WARN, f"disarmed: {disarmed}"
    return DiagnosticStatus.OK, "running"
