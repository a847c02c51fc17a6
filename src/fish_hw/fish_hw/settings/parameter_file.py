"""Settings from a ROS parameter file, for commands that run without ROS."""

from dataclasses import fields
from pathlib import Path
from typing import Any, TypeVar

import yaml

Settings = TypeVar("Settings")


def read_parameter_file(path: Path, settings_class: type[Settings]) -> Settings:
    """Settings of the first entry's ros__parameters.

    Raises:
        ValueError: unreadable file, unknown parameter or refused value; names the file.
    """
    try:
        document: Any = yaml.safe_load(path.read_text())
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
        raise ValueError(f"{path}: {' '.join(str(error).split())}") from error
    parameters = _parameters(document)
    if parameters is None:
        raise ValueError(f"{path}: expected a node name with ros__parameters below it")
    known = {field.name for field in fields(settings_class)}  # type: ignore[arg-type]
    unknown = sorted(set(parameters) - known)
    if unknown:
        raise ValueError(f"{path}: unknown {', '.join(unknown)}; known: {', '.join(sorted(known))}")
    try:
        return settings_class(**parameters)
    except (TypeError, ValueError) as error:
        raise ValueError(f"{path}: {error}") from error


def _parameters(document: Any) -> dict[str, Any] | None:
    if not isinstance(document, dict):
        return None
    entries = [entry for entry in document.values() if isinstance(entry, dict)]
    found = entries[0].get("ros__parameters") if entries else None
    return found if isinstance(found, dict) else None
