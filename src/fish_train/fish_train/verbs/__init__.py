# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Commands of this package for `robofish`, one module each."""
