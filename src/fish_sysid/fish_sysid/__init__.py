# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""System identification and diagnosis: fits the robot's parameters and names the physics that its model lacks."""
