"""Labels sealed before the run and opened after it: SHA-256 of a random salt and the label's JSON."""

from __future__ import annotations

import hashlib
import json
import secrets
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Sealed:
    """A label and the salt that keeps its hash from being guessed."""

    salt: str
    label: Mapping[str, Any]

    @property
    def seal(self) -> str:
        """What is published before the run."""
        text = json.dumps(self.label, sort_keys=True, separators=(",", ":"))
        return hashlib.sha256(f"{self.salt}:{text}".encode()).hexdigest()


def seal_label(label: Mapping[str, Any]) -> Sealed:
    """A label with a fresh salt."""
    return Sealed(secrets.token_hex(16), label)


def broken_seals(seals: Mapping[str, str], opened: Mapping[str, Sealed]) -> list[str]:
    """Names whose opened label is not the one that was sealed, or is missing, or was never sealed."""
    names = {*seals, *opened}
    return sorted(n for n in names if n not in opened or seals.get(n) != opened[n].seal)
