# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Tests of symmetries that no fish can break: what they find needs no model of the fish."""
