# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Kalman fusion, reference paths, line-of-sight planner and PID with learned gains."""
