# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""ROS domains: ports of the RTPS standard, use seen by binding them."""

import socket

import pytest

from fish_node import domain


def test_ports_are_those_of_the_standard():
    # OMG DDSI-RTPS: domain 0, participants 0 and 1 listen on 7410 and 7412; domain 1 starts 250 higher
    assert [
        domain.discovery_port(0, 0),
        domain.discovery_port(0, 1),
        domain.discovery_port(1, 0),
    ] == [
        7410,
        7412,
        7660,
    ]


def test_a_domain_with_a_participant_is_in_use_and_refused():
    free = domain.choose_domain()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as participant:
        participant.bind(("", domain.discovery_port(free, 3)))
        assert domain.domain_in_use(free)
        with pytest.raises(domain.DomainError, match=f"domain {free} is in use"):
            domain.choose_domain(free)
    assert domain.choose_domain(free) == free


@pytest.mark.parametrize("number", [-1, 233])
def test_a_domain_out_of_range_is_refused(number):
    with pytest.raises(domain.DomainError, match="0 to 232"):
        domain.choose_domain(number)


def test_all_domains_in_use_is_said(monkeypatch):
    monkeypatch.setattr(domain, "domain_in_use", lambda _: True)
    with pytest.raises(domain.DomainError, match="all ROS domains"):
        domain.choose_domain()
