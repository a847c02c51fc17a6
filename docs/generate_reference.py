# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Write the generated pages of docs/reference, or check that they are current.

    python docs/generate_reference.py            # writes the pages
    python docs/generate_reference.py --check    # exit status 1 if a page differs from the code

The workspace must be built and sourced.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

from reference_pages import parameters, physics, topics, verbs

REFERENCE = Path(__file__).parent / "reference"
PAGES: dict[str, Callable[[], str]] = {
    "verbs.md": verbs.page,
    "parameters.md": parameters.page,
    "topics.md": topics.page,
    "effects.md": physics.effects_page,
    "robot.md": physics.robot_page,
}


def differing_pages() -> list[str]:
    """Names of the pages whose file is missing or not what the code gives."""
    files = {name: REFERENCE / name for name in PAGES}
    return [
        name
        for name, make in PAGES.items()
        if not files[name].exists() or files[name].read_text(encoding="utf-8") != make()
    ]


def main() -> int:
    """Write or check; the exit status."""
    if "--check" in sys.argv[1:]:
        if differing := differing_pages():
            print(f"not current: {', '.join(differing)}; run python docs/generate_reference.py")
            return 1
        return 0
    for name, make in PAGES.items():
        (REFERENCE / name).write_text(make(), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
