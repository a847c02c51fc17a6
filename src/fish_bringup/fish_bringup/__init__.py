# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Starts the robot: node table, process starter, launch files, demo, score, excite."""
