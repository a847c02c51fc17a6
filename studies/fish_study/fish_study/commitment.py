# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Commitments to labels: SHA-256 of a random salt and the label's JSON, published before the run and checked after it."""

from __future__ import annotations

import hashlib
import json
import secrets
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Opening:
    """What opens a commitment: the label and the salt that keeps its hash from being guessed."""

    salt: str
    label: Mapping[str, Any]

    @property
    def commitment(self) -> str:
        """What is published before the run."""
        text = json.dumps(self.label, sort_keys=True, separators=(",", ":"))
        return hashlib.sha256(f"{self.salt}:{text}".encode()).hexdigest()


def commit(label: Mapping[str, Any]) -> Opening:
    """A label with a fresh salt."""
    return Opening(secrets.token_hex(16), label)


def broken_commitments(
    commitments: Mapping[str, str], openings: Mapping[str, Opening]
) -> list[str]:
    """Names whose label is not the one that was committed to, is missing, or has no commitment."""
    names = {*commitments, *openings}
    return sorted(
        n for n in names if n not in openings or commitments.get(n) != openings[n].commitment
    )
