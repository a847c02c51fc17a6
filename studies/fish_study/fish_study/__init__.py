# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The blind study: scenarios with a concealed effect, the tool run on each without the label, labels opened afterwards."""
