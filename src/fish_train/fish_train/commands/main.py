"""The `fish_train` command: `fish_train VERB ...`, or every verb as an executable of its own."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from functools import partial
from importlib import import_module
from typing import NoReturn

from fish_train.errors import UserError

from .verbs import VERBS

BRINGS_PACKAGES = (
    "`make setup`, or `pip install -r requirements-diagnose.txt -r requirements-train.txt`, brings it"
)


class OneLineParser(argparse.ArgumentParser):
    """Says what is wrong with an argument in one line; usage comes with --help."""

    def error(self, message: str) -> NoReturn:
        """End with status 2."""
        self.exit(2, f"{self.prog}: {message} (--help says more)\n")


def main(argv: list[str] | None = None) -> int:
    """Run one verb; its module is imported only now, so that help is fast."""
    arguments = sys.argv[1:] if argv is None else argv
    if not arguments or arguments[0] in ("-h", "--help"):
        print(usage())
        return 0 if arguments else 2
    verb, *rest = arguments
    if verb not in VERBS:
        print(f"fish_train: unknown verb {verb!r}; known: {', '.join(VERBS)}", file=sys.stderr)
        return 2
    return run_verb(verb, rest)


def usage() -> str:
    """The table of verbs."""
    width = max(map(len, VERBS))
    lines = [f"  {verb:<{width}}  {text}" for verb, text in VERBS.items()]
    return "\n".join(["usage: fish_train VERB ...   (fish_train VERB --help says more)", "", *lines])


def run_verb(verb: str, argv: list[str] | None = None) -> int:
    """Parse the arguments of one verb and run it; errors the user can mend become one line and status 1."""
    try:
        module = import_module(f"{__package__}.{verb}")
        parser = OneLineParser(prog=f"fish_train {verb}", description=module.__doc__)
        module.add_arguments(parser)
        return int(module.run(parser.parse_args(argv)))
    except ModuleNotFoundError as error:
        missing = (error.name or "").split(".")[0]
        if not missing or missing.startswith("fish_"):
            raise
        print(
            f"fish_train {verb}: the Python package {missing} is not installed; {BRINGS_PACKAGES}",
            file=sys.stderr,
        )
        return 1
    except UserError as error:  # what a library says of a file in it may have several lines
        print(f"fish_train {verb}: {' '.join(str(error).split())}", file=sys.stderr)
        return 1
    except OSError as error:
        where = f"{error.filename}: " if error.filename else ""
        print(f"fish_train {verb}: {where}{error.strerror or error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print(f"fish_train {verb}: interrupted", file=sys.stderr)
        return 130


def __getattr__(name: str) -> Callable[[], int]:
    """`from fish_train.commands.main import inspect`: the entry point of a verb's own executable."""
    if name in VERBS:
        return partial(run_verb, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


if __name__ == "__main__":
    sys.exit(main())
