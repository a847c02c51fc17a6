# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Devices made of software, for tests and for trying the nodes with no hardware."""
