# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Shared by the tests of this package: emulated devices that are always given back."""

import os
import sys
from pathlib import Path

import pytest

os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
sys.path.insert(0, str(Path(__file__).parent))

from fish_hw.emulators.vertiq import VertiqEmulator


@pytest.fixture
def vertiq_emulator():
    emulator = VertiqEmulator()
    yield emulator
    emulator.close()
