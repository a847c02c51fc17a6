# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Multiple shooting: windows of measurements, each with a start state of its own that the fit eliminates."""
