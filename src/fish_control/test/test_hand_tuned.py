# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The constant gains that ship as baseline."""

import subprocess
import sys

from fish_control.gains_file import read_gains_file
from fish_control.hand_tuned import HAND_TUNED


def test_the_module_writes_them_as_a_weights_file(tmp_path):
    file = tmp_path / "w.safetensors"
    subprocess.run([sys.executable, "-m", "fish_control.hand_tuned", str(file)], check=True)
    assert read_gains_file(file).gains([0.0] * 6) == HAND_TUNED
