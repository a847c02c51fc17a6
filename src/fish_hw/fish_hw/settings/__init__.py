# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""One frozen dataclass per node: its fields are the ROS parameters, checked when it is made."""
