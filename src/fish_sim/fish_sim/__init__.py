# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The differentiable simulator of a rotor-driven robot fish, its sensors and the rendered pool."""
