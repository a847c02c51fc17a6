"""Settings from a ROS parameter file, for commands that run without ROS."""

from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any, TypeVar

import yaml

from fish_node.parameters import in_type_of, unknown_names

Settings = TypeVar("Settings")


def read_parameter_file(path: Path, settings_class: type[Settings], warn: Callable[[str], None]) -> Settings:
    """Settings of the first entry's ros__parameters; parameters that are unknown are said to `warn` and left out.

    Raises:
        ValueError: unreadable file or refused value; names the file.
    """
    try:
        document: Any = yaml.safe_load(path.read_text())
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
        raise ValueError(f"{path}: {' '.join(str(error).split())}") from error
    parameters = _parameters(document)
    if parameters is None:
        raise ValueError(f"{path}: expected a node name with ros__parameters below it")
    defaults = asdict(settings_class())  # type: ignore[call-overload]
    if unknown := unknown_names(parameters, defaults):
        warn(f"{path}: {unknown}")
    known = {name: value for name, value in parameters.items() if name in defaults}
    try:
        values = {name: in_type_of(name, value, defaults[name]) for name, value in known.items()}
        return settings_class(**values)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from error


def _parameters(document: Any) -> dict[str, Any] | None:
    if not isinstance(document, dict):
        return None
    entries = [entry for entry in document.values() if isinstance(entry, dict)]
    found = entries[0].get("ros__parameters") if entries else None
    return found if isinstance(found, dict) else None
