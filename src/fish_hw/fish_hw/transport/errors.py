# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What can go wrong with a port."""


class TransportError(Exception):
    """A port failed while it was in use: unplugged, bus error, time-out."""


class PortUnavailable(TransportError):
    """A port cannot be opened; the message names the port, the reason and the alternatives."""


def unavailable(port: str, reason: str, alternatives: list[str]) -> PortUnavailable:
    """PortUnavailable with one line: what was asked for, why not, what there is instead."""
    found = ", ".join(alternatives) if alternatives else "none found"
    return PortUnavailable(f"cannot open {port}: {reason}; available: {found}")
