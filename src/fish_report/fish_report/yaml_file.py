# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""A YAML file that a person has written: whatever is wrong with it is one error that says what."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import yaml


class _Loader(yaml.SafeLoader):  # type: ignore[misc]
    """YAML without two entries of one name, of which PyYAML would take the last."""


def _unique(loader: _Loader, node: yaml.MappingNode) -> dict[Any, Any]:
    names = [key.value for key, _ in node.value if isinstance(key, yaml.ScalarNode)]
    twice = [name for name in names if names.count(name) > 1]
    if twice:
        line = node.start_mark.line + 1
        raise ValueError(
            f"{twice[0]} is given twice in the table of line {line}; keep one of the two"
        )
    return dict(loader.construct_mapping(node, deep=True))


_Loader.add_constructor(yaml.resolver.BaseResolver.DEFAULT_MAPPING_TAG, _unique)


def read_yaml(path: Path) -> Any:
    """What the file holds; None of an empty one.

    Raises:
        ValueError: it cannot be read, is no YAML, or has a table with two entries of one name.
    """
    try:
        return yaml.load(path.read_text(encoding="utf-8"), Loader=_Loader)
    except OSError as error:
        raise ValueError(f"cannot be read: {error.strerror or error}") from error
    except RecursionError:
        raise ValueError("cannot be read as YAML: its tables are nested too deeply") from None
    except (yaml.YAMLError, ValueError) as error:  # also no UTF-8, or a date such as 2020-13-45
        raise ValueError(f"cannot be read as YAML: {error}") from error
