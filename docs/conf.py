# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Settings of the documentation (Sphinx): Markdown by MyST, the theme furo, the Python API by autodoc."""

import re
from typing import Any

project = "Robot fish"
author = copyright = "Robot fish maintainers"
release = version = "0.1.0"

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
exclude_patterns = ["_build", "studies", "blind_studies.md"]
smartquotes = False  # x' is a derivative
highlight_language = "none"  # of blocks that name no language
html_theme = "furo"
html_title = "Robot fish"
html_static_path = ["_static"]
html_css_files = ["tables.css"]
html_theme_options = {"navigation_with_keys": True}

myst_heading_anchors = 3  # links to headings as GitHub writes them
myst_enable_extensions = ["colon_fence"]

autodoc_typehints = "signature"
autodoc_member_order = "bysource"
autodoc_preserve_defaults = True
napoleon_google_docstring = True
napoleon_numpy_docstring = False
python_use_unqualified_type_names = True
default_role = "code"  # docstrings mark code by single backticks
nitpicky = False

SECTION = re.compile(r"^(Args|Arguments|Attributes|Returns|Raises|Yields|Examples?|Notes?):\s*$")


def plain_text(
    _app: Any, what: str, _name: str, _obj: Any, _options: Any, lines: list[str]
) -> None:
    """Make a docstring valid reStructuredText: bars and stars are plain text, an indented equation is a literal block."""
    if (
        what in ("property", "attribute") and lines
    ):  # napoleon takes what stands before a colon for a type
        lines[0] = lines[0].replace(": ", " – ", 1)
    out: list[str] = []
    literal = section = False
    for line in lines:
        section = section or bool(SECTION.match(line))
        indented = line.startswith("    ") and bool(line.strip())
        if not section and indented and not literal and (not out or not out[-1].strip()):
            out += ["::", ""]
            literal = True
        elif literal and line.strip() and not indented:
            literal = False
        out.append(line if literal else escape(line))
    lines[:] = out


def escape(line: str) -> str:
    """Escape what reStructuredText would read as markup, outside of code."""
    parts = line.split("`")
    return "`".join(
        part if k % 2 and len(parts) % 2 else re.sub(r"([|*\\]|(?<=\w)_(?=\W|$))", r"\\\1", part)
        for k, part in enumerate(parts)
    )


def setup(app: Any) -> None:
    """Connect before napoleon, which has priority 500."""
    app.connect("autodoc-process-docstring", plain_text, priority=400)
