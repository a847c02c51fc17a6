# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The fish as a picture: its joint angles for robot_state_publisher."""
