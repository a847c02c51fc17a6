# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""A device that is reachable but does not do what it should."""


class DeviceError(Exception):
    """The port works, the device behind it does not answer or refuses a setting."""
