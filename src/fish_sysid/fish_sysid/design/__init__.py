# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Design of experiments: what a swim would say of a robot, before anybody swims it."""
