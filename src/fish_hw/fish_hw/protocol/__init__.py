# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Bytes to messages and back, pure: parsers are objects with feed(bytes) that count and drop what is
wrong.
"""
