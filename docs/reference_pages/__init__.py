# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The generated pages of docs/reference: one module a page, each with `page() -> str`."""
