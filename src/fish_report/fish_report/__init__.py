# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What people read and type: the command robofish, HTML pages, tables, JSON files, worker pools, user errors."""
