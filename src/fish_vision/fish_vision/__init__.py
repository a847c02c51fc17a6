# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Overhead-camera tracker: calibration, HSV segmentation, markers to pose."""
