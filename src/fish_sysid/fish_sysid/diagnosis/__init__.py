# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Diagnosis: where recordings and model differ, which physics is missing, how sure that is."""
