# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Learning the controller's gains through the simulator."""
