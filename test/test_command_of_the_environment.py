# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The command robofish that the virtual environment has: runs the sourced workspace's, or says that there is none."""

import os
import subprocess
from pathlib import Path

import pytest

COMMAND = Path(__file__).parents[1] / "src" / "fish_report" / "bin" / "robofish"
MAKEFILE = Path(__file__).parents[1] / "Makefile"


def run(prefixes, *arguments):
    environment = {**os.environ, "AMENT_PREFIX_PATH": prefixes}
    return subprocess.run([COMMAND, *arguments], env=environment, capture_output=True, text=True)


@pytest.mark.parametrize("prefixes", ["", "/nowhere:/opt/ros/*"])
def test_without_a_workspace_it_is_one_line(prefixes):
    ended = run(prefixes, "inspect", "x")
    assert (ended.returncode, ended.stdout) == (1, "")
    assert ended.stderr.startswith("robofish: ")
    assert "source install/setup.bash first" in ended.stderr
    assert ended.stderr.count("\n") == 1


def test_with_one_its_own_executable_gets_every_argument(tmp_path):
    executable = tmp_path / "a b" / "lib" / "fish_report" / "robofish"
    executable.parent.mkdir(parents=True)
    executable.write_text('#!/bin/sh\nprintf "%s|" "$@"\nexit 7\n')
    executable.chmod(0o755)
    ended = run(f"/nowhere:{tmp_path}/a b", "score", "a: b", "*", "")
    assert (ended.returncode, ended.stdout, ended.stderr) == (7, "score|a: b|*||", "")


@pytest.mark.skipif(not MAKEFILE.exists(), reason="not in this project's tree")
def test_it_is_what_make_build_links():
    assert f"../../src/fish_report/bin/{COMMAND.name} $(VENV)/bin/robofish" in MAKEFILE.read_text()
