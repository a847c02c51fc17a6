# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Training of the controller's gains, and evaluation of how well they follow paths."""
