# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The command `robofish`: `robofish VERB ...`, or every verb as an executable of its own package.

A verb is a module with `add_arguments(parser)` and `run(args) -> int` (exit status). A package offers its verbs by
the entry-point group `robofish.verbs`. The first line of the module's docstring is the verb's line in the table.
"""

from __future__ import annotations

import argparse
import ast
import os
import sys
from collections.abc import Callable, Sequence
from functools import partial
from importlib.metadata import EntryPoint, entry_points
from io import TextIOWrapper
from pathlib import Path
from typing import Any, NoReturn

from fish_report.errors import UserError
from fish_report.printable import plain


def words_after(verb: str, argv: Sequence[str]) -> list[str]:
    """Words after the verb, of `robofish VERB ...` as of the verb's own executable."""
    return list(argv[2:] if argv[1:2] == [verb] else argv[1:])


GROUP = "robofish.verbs"
LONGEST_ERROR = 2000  # characters
# the project's own verbs and the package that brings each: for the message where that package is not installed
BROUGHT_BY = {
    "demo": "fish_bringup",
    "score": "fish_bringup",
    "latency": "fish_bringup",
    "excite": "fish_bringup",
    "arm": "fish_bringup",
    "disarm": "fish_bringup",
    "view": "fish_bringup",
    "drive": "fish_bringup",
    "loopback": "fish_bringup",
    "calibrate": "fish_vision",
    "track": "fish_vision",
    "inspect": "fish_bag",
    "recover": "fish_bag",
    "import_pool": "fish_bag",
    "identify": "fish_sysid",
    "diagnose": "fish_sysid",
    "predict": "fish_sysid",
    "coverage": "fish_sysid",
    "plan_calibration": "fish_sysid",
    "distinguish": "fish_sysid",
    "train": "fish_train",
    "evaluate": "fish_train",
    "weights": "fish_train",
    "prove": "fish_study",
    "paper": "fish_study",
}
# what brings the packages that the robot does not need; other ones: all of these files
FILES = {
    "statsmodels": "-r requirements-diagnose.txt",
    "torch": "-r requirements-train.txt",
    "tensorboard": "-r requirements-train.txt",
}
EVERY_FILE = "-r requirements-diagnose.txt -r requirements-train.txt"


class OneLineParser(argparse.ArgumentParser):
    """Says what is wrong with an argument in one line; usage comes with --help. Options are written out."""

    def __init__(self, **options: Any) -> None:
        super().__init__(**{"allow_abbrev": False, **options})

    def error(self, message: str) -> NoReturn:
        """End with status 2."""
        self.exit(2, f"{self.prog}: {message} (--help says more)\n")


def installed_verbs() -> dict[str, EntryPoint]:
    """Verb -> entry point of every installed package, the project's own verbs first and in the order of their table."""
    found = {entry.name: entry for entry in entry_points(group=GROUP)}
    order = [name for name in BROUGHT_BY if name in found]
    return {name: found[name] for name in (*order, *sorted(set(found) - set(order)))}


def main(argv: list[str] | None = None) -> int:
    """Run one verb; its module is imported only now, so that help is fast."""
    arguments = sys.argv[1:] if argv is None else argv
    if not arguments or arguments[0] in ("-h", "--help"):
        print(usage())
        return 0 if arguments else 2
    verb, *rest = arguments
    return run_verb(verb, rest)


def usage() -> str:
    """The table of verbs."""
    verbs = installed_verbs()
    width = max(map(len, verbs), default=0)
    lines = [f"  {verb:<{width}}  {_summary(entry)}" for verb, entry in verbs.items()]
    return "\n".join(["usage: robofish VERB ...   (robofish VERB --help says more)", "", *lines])


def run_verb(verb: str, argv: list[str] | None = None) -> int:
    """Parse the arguments of one verb and run it; an error that the user can mend becomes one line and status 1."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(
            stream, TextIOWrapper
        ):  # a terminal or pipe in another encoding shows ? for what it lacks
            stream.reconfigure(errors="replace")
    # before numpy is imported; threads in the algebra of small matrices take up to ten times the processor time
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    verbs, verb = installed_verbs(), verb.replace("-", "_")
    if verb not in verbs:
        print(f"robofish: {_unknown(verb, verbs)}", file=sys.stderr)
        return 2
    try:
        module = verbs[verb].load()
        parser = OneLineParser(prog=f"robofish {verb}", description=module.__doc__)
        module.add_arguments(parser)
        return int(module.run(parser.parse_args(argv)))
    except ModuleNotFoundError as error:
        missing = (error.name or "").split(".")[0]
        if not missing or missing.startswith("fish_"):
            raise
        files = FILES.get(missing, EVERY_FILE)
        said = f"the Python package {missing} is not installed; `make setup`, or `pip install {files}`, brings it"
    except UserError as error:  # a library's text on a file may have several lines
        said = " ".join(str(error).split())
    except OSError as error:
        where = f"{error.filename}: " if error.filename else ""
        said = f"{where}{error.strerror or error}"
    except KeyboardInterrupt:
        print(f"robofish {verb}: interrupted", file=sys.stderr)
        return 130
    print(plain(f"robofish {verb}: {said}", LONGEST_ERROR), file=sys.stderr)
    return 1


def _unknown(verb: str, verbs: dict[str, EntryPoint]) -> str:
    if verb in BROUGHT_BY:
        package = BROUGHT_BY[verb]
        build = "make install/.studies" if package == "fish_study" else "make build"
        missing = (
            f"the verb {verb} comes with package {package}, which is not in this shell's workspace"
        )
        return f"{missing}; build it ({build}) and source install/setup.bash"
    return f"unknown verb {verb!r}; known: {', '.join(verbs)}"


def _summary(entry: EntryPoint) -> str:
    """First line of the docstring of a verb's module, read as text: importing fifteen verbs takes seconds."""
    file = entry.value.replace(".", "/") + ".py"
    place = entry.dist.locate_file(file) if entry.dist else file
    try:
        text = ast.get_docstring(ast.parse(Path(str(place)).read_text(encoding="utf-8"))) or ""
    except (OSError, SyntaxError):
        return ""
    return text.partition("\n")[0]


def __getattr__(name: str) -> Callable[[], int]:
    """`fish_report.robofish:inspect` is the entry point of a verb's own executable."""
    if name in BROUGHT_BY:
        return partial(run_verb, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


if __name__ == "__main__":
    sys.exit(main())
