# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Verbs of the command `robofish`, and what they share."""
