"""Settings from a ROS parameter file, for commands that run without ROS."""

from dataclasses import asdict
from pathlib import Path
from typing import Any, TypeVar

import yaml

from fish_hw.settings.checks import in_type_of

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
    defaults = asdict(settings_class())  # type: ignore[call-overload]
    unknown = sorted(str(name) for name in set(parameters) - set(defaults))
    if unknown:
        raise ValueError(f"{path}: unknown {', '.join(unknown)}; known: {', '.join(sorted(defaults))}")
    try:
        values = {name: in_type_of(defaults[name], value, name) for name, value in parameters.items()}
        return settings_class(**values)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from error


def _parameters(document: Any) -> dict[str, Any] | None:
    if not isinstance(document, dict):
        return None
    entries = [entry for entry in document.values() if isinstance(entry, dict)]
    found = entries[0].get("ros__parameters") if entries else None
    return found if isinstance(found, dict) else None
