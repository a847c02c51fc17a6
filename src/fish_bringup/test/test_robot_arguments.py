# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""A namespace or a domain that no robot can have is refused in one line by every verb that takes them."""

from __future__ import annotations

import pytest

from fish_report.robofish import run_verb

VERBS = ("arm", "disarm", "drive", "view")
WRONG = ("bad name!", "", "/fish//two", "/2fish", "/", "/fish__2")


@pytest.mark.parametrize("verb", VERBS)
@pytest.mark.parametrize("namespace", WRONG)
def test_a_namespace_that_ros_does_not_know_is_refused(verb: str, namespace: str, capsys) -> None:
    assert run_verb(verb, ["--namespace", namespace]) == 1
    said = capsys.readouterr().err
    assert said.startswith(f"robofish {verb}: namespace is {namespace!r}, expected")
    assert said.count("\n") == 1


@pytest.mark.parametrize("verb", VERBS)
@pytest.mark.parametrize("domain", ["-1", "233"])
def test_a_domain_out_of_range_is_refused(verb: str, domain: str, capsys) -> None:
    assert run_verb(verb, ["--domain", domain]) == 1
    assert capsys.readouterr().err == f"robofish {verb}: domain is {domain}, expected 0 to 232\n"
