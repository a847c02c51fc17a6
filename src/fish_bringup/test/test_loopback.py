# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The shell lines that keep messages on this computer."""

import subprocess

from fish_bringup.node_table import middleware
from fish_report.robofish import run_verb


def test_a_shell_takes_the_lines_over(capsys):
    assert run_verb("loopback", []) == 0
    lines = capsys.readouterr().out
    wanted = middleware()
    shown = subprocess.run(
        ["bash", "-c", lines + "".join(f'echo "${name}"\n' for name in wanted)],
        capture_output=True,
        text=True,
        check=True,
        env={"PATH": "/usr/bin:/bin"},
    )
    assert shown.stdout.splitlines() == list(wanted.values())
