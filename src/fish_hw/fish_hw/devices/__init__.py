# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Devices: registers and commands as data, SI units and REP-103 axes at their surface, time passed in or
injected.
"""
