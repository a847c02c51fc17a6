# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""ROS domains on this machine: is one in use, and which is free."""

from __future__ import annotations

import errno
import random
import socket

LAST_DOMAIN = 232  # RTPS: UDP ports end at 65535
FREE_RANGE = range(1, 102)  # domains whose ports lie below Linux' ephemeral ones (32768)
PARTICIPANTS = 12  # participant ids looked at; a robot has fewer processes


class DomainError(ValueError):
    """A domain that cannot be used; the text says why and what to do."""


def discovery_port(domain: int, participant: int) -> int:
    """UDP port a participant listens on for discovery.

    7400 + 250 domain + 10 + 2 participant

    Source: OMG DDSI-RTPS 2.5, section 9.6.2.3 (default port parameters).
    """
    return 7400 + 250 * domain + 10 + 2 * participant


def domain_in_use(domain: int) -> bool:
    """Whether some process of this machine takes part in the domain."""
    return any(
        _port_taken(discovery_port(domain, participant)) for participant in range(PARTICIPANTS)
    )


def choose_domain(asked: int | None = None) -> int:
    """The domain asked for, or a free one.

    Raises:
        DomainError: the domain is out of range, in use, or all are.
    """
    if asked is None:
        for domain in random.sample(FREE_RANGE, len(FREE_RANGE)):
            if not domain_in_use(domain):
                return domain
        raise DomainError(
            f"all ROS domains {FREE_RANGE.start} to {FREE_RANGE.stop - 1} are in use; end other robots first"
        )
    if not 0 <= asked <= LAST_DOMAIN:
        raise DomainError(f"ROS domain {asked} is out of range; expected 0 to {LAST_DOMAIN}")
    if domain_in_use(asked):
        raise DomainError(
            f"ROS domain {asked} is in use on this machine; choose another or leave it out"
        )
    return asked


def _port_taken(port: int) -> bool:
    if port > 65535:
        return False
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.bind(("", port))
        except OSError as error:
            if error.errno == errno.EADDRINUSE:
                return True
            raise DomainError(
                f"cannot open UDP port {port}: {error.strerror}; ROS 2 needs it"
            ) from error
    return False
