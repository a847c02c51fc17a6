# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Constant gains found by hand in the closed loop with simulated sensors; the baseline of every learned policy.

`python -m fish_control.hand_tuned FILE` writes them as a weights file.

How: proportional and derivative gain of steering as high as they go before the rudder begins to wag (a limit cycle
that swims by itself and shows as a speed error) with drags 30 % lower, tail stiffness 30 % higher or head inertia
30 % lower; integral gain as high as it helps against a current of 0.03 m/s; speed gains for the smallest speed error
on the letters R and S at 0.1 to 0.25 m/s. test_closed_loop.py swims with them.
"""

from __future__ import annotations

import sys

from fish_control.control_law import Gains
from fish_control.gains_file import write_gains_file
from fish_control.policy import Policy
from fish_control.policy_spec import PolicySpec

HAND_TUNED = Gains(
    steering_kp=0.28, steering_ki=0.4, steering_kd=0.03, speed_kp=0.6, speed_ki=0.07, speed_kd=0.0
)


def hand_tuned_policy() -> Policy:
    """The gains with the contract of this version's control law."""
    return Policy.constant(HAND_TUNED, PolicySpec(layers=(), note="constant gains, tuned by hand"))


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("usage: python -m fish_control.hand_tuned FILE.safetensors")
    write_gains_file(sys.argv[1], hand_tuned_policy())
