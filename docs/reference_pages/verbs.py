# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The page of the command `robofish`: every verb with the arguments that its parser declares."""

from __future__ import annotations

import argparse
import importlib
import re

from fish_report.robofish import BROUGHT_BY
from reference_pages import HEADER, cell, escaped, table

INTRODUCTION = """# The command `robofish`

`robofish VERB` runs one tool. Every verb is also an executable of its package: `ros2 run PACKAGE VERB`. A package of
your own adds verbs through the entry-point group `robofish.verbs`. Exit status: 0 done, 1 an input cannot be used
(one line says why), 2 the command line cannot be understood, 130 ended by Ctrl-C.
`prove` and `paper` need the package `fish_study`: `make install/.studies` builds it, then source the workspace again.
"""


class ArgumentList(argparse.ArgumentParser):
    """A parser that tells what it declares."""

    def __init__(self, **_: object) -> None:  # the parsers of sub-commands are made with a prog
        super().__init__(add_help=False)

    @property
    def declared(self) -> list[argparse.Action]:
        """All arguments and sub-commands; those of argument groups too."""
        return self._actions


def declared_by(verb: str) -> tuple[str, list[argparse.Action]]:
    """The module docstring of a verb and the arguments that it declares."""
    module = importlib.import_module(f"{BROUGHT_BY[verb]}.verbs.{verb}")
    parser = ArgumentList()
    module.add_arguments(parser)
    return module.__doc__ or "", parser.declared


def page() -> str:
    """All verbs."""
    summaries = (
        (f"[`{verb}`](#{verb})", cell(declared_by(verb)[0].partition("\n")[0]))
        for verb in BROUGHT_BY
    )
    sections = [section(verb) for verb in BROUGHT_BY]
    return "\n".join([HEADER, INTRODUCTION, table(("verb", "what it does"), summaries), *sections])


def section(verb: str) -> str:
    """One verb."""
    text, arguments = declared_by(verb)
    rows = [line for action in arguments for line in rows_of(action)]
    body = table(("argument", "meaning", "default"), rows)
    return f"## {verb}\n\nPackage `{BROUGHT_BY[verb]}`. {escaped(text.strip())}\n\n{body}"


def rows_of(action: argparse.Action) -> list[tuple[str, str, str]]:
    """The row of an argument, or those of all sub-commands."""
    if not isinstance(action.choices, dict):
        return [row(action)]
    rows = []
    for name, parser in action.choices.items():
        rows.append((f"**{name}**", "", ""))
        rows += [row(declared) for declared in parser.declared]
    return rows


def row(action: argparse.Action) -> tuple[str, str, str]:
    """Name, meaning and default of one argument."""
    value = action.metavar or (
        "{" + ",".join(map(str, action.choices)) + "}" if action.choices else action.dest.upper()
    )
    value = value if isinstance(value, str) else " ".join(value)
    many = {"+": f"{value} ...", "*": f"[{value} ...]", "?": f"[{value}]"}
    value = many.get(str(action.nargs), value)
    takes_value = action.nargs != 0
    if action.option_strings:
        name = f"{', '.join(action.option_strings)} {value if takes_value else ''}".strip()
    else:
        name = value
    absent = action.default is None or action.default is False  # 0 is a default to be shown
    default = "" if absent or action.default in ([], "", argparse.SUPPRESS) else action.default
    if action.dest == "jobs":  # the number of processors of the computer that makes this page
        default = "all processors"
    if isinstance(default, list):
        default = " ".join(map(str, default))
    help_text = re.sub(r"[;,]? ?\(?default:? %\(default\)s\)?", "", action.help or "")
    help_text = help_text.replace("%(default)s", str(default)).replace("%%", "%")
    return f"`{name}`".replace("|", "\\|"), cell(help_text), cell(str(default))
