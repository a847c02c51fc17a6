# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What changed between recordings of one robot, although the model of it is wrong."""
