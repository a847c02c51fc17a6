# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Numbers printed in the paper of the robot fish, beside which ours are shown; SI units."""

SPEEDS = (0.10, 0.15, 0.20, 0.25)  # m/s
LETTERS = ("I", "R", "O", "S")

# real robot: letter -> RMSE at SPEEDS
CROSS_TRACK = {  # m
    "I": (0.016, 0.019, 0.011, 0.012),
    "R": (0.104, 0.061, 0.049, 0.025),
    "O": (0.122, 0.073, 0.088, 0.024),
    "S": (0.084, 0.049, 0.043, 0.046),
}
SPEED = {  # m/s
    "I": (0.036, 0.041, 0.031, 0.040),
    "R": (0.030, 0.032, 0.039, 0.061),
    "O": (0.025, 0.015, 0.041, 0.041),
    "S": (0.023, 0.022, 0.028, 0.075),
}

# simulation: path specification, wanted speed [m/s], mean cross-track error [m], speed error [m/s]
SINUSOID = ("sinusoid:amplitude=0.5", 0.12, 0.01, 0.05)
CIRCLE = ("circle:radius=0.6", 0.30, 0.01, 0.05)

# the open-loop case of the phase portrait
PORTRAIT_AMPLITUDE = 9.0  # rad
PORTRAIT_FREQUENCY = 2.0  # Hz
SEEDS = 9  # of the training curve
