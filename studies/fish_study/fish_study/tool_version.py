# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Which tool a study examines: a digest of the code that an answer depends on, so that no table mixes two of them."""

from __future__ import annotations

import ast
import hashlib
from collections.abc import Iterable
from importlib.resources import files
from importlib.resources.abc import Traversable

from fish_study.study import StudyError

PARTS = (("fish_sim", ""), ("fish_bag", ""), ("fish_sysid", ""))
KINDS = (".py", ".c", ".h")
NODES = "nodes"  # folder of what talks ROS; an answer comes from recordings


def tool_digest() -> str:
    """The first 16 digits of the SHA-256 of simulator (less its nodes), identification, diagnosis, reader and their commands."""
    digest = hashlib.sha256()
    for package, folder in PARTS:
        root = files(package)
        for name, text in sorted(_texts(root / folder if folder else root, folder)):
            digest.update(f"{package} {folder} {name}\n{text}".encode())
    return digest.hexdigest()[:16]


def checked_version(expected: str, who: str) -> str:
    """The digest of the tool that is here now, for who is about to use it. Raises StudyError unless it is the expected one.

    A checkout may change while a study runs, and a cluster's workers may have another. "": any is good.
    """
    digest = tool_digest()
    if expected and digest != expected:
        raise StudyError(
            f"{who}: got version {digest} of the tool, expected {expected}, as the study has: go back to that version, then the"
            " same command goes on"
        )
    return digest


def code(text: str) -> str:
    """Python without comments, docstrings and layout, of which no answer depends on any."""
    tree = ast.parse(text)
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            first = node.body[0] if node.body else None
            if isinstance(first, ast.Expr) and isinstance(getattr(first.value, "value", None), str):
                node.body = node.body[1:] or [ast.Pass()]
    return ast.unparse(tree)


def _texts(place: Traversable, name: str = "") -> Iterable[tuple[str, str]]:
    if place.is_dir():
        for entry in place.iterdir():
            if entry.name != NODES:
                yield from _texts(entry, f"{name}/{entry.name}".lstrip("/"))
    elif name.endswith(KINDS):
        text = place.read_text(encoding="utf-8")
        yield name, code(text) if name.endswith(".py") else text
