# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The error that commands show as one line."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager


class UserError(Exception):
    """Something the user can mend: the text says what came, what was expected and what to do."""


@contextmanager
def user_errors() -> Iterator[None]:
    """Turn the ValueErrors of a core, whose texts are written for the user, into UserErrors."""
    try:
        yield
    except ValueError as error:
        raise UserError(str(error)) from error
