# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The pool's walls: origin at the centre, x along the long side."""

LENGTH = 4.27  # m, along x; measured
WIDTH = 2.13  # m, along y; measured
