# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""How well gains follow paths: on any plant, with perfect or realistic sensing."""
