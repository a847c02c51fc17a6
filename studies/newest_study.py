# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Keep the newest blind study.

python studies/newest_study.py pack FILE.tar.xz FOLDER [FOLDER ...]    puts finished studies into one file
python studies/newest_study.py page                                    writes its numbers into docs/results/blind_studies.md
"""

import argparse
from pathlib import Path

from fish_study.results_page import results_text, write_generated_part
from fish_study.study import Study, pack_studies

STUDIES = Path(__file__).parent
NEWEST = STUDIES / "data" / "blind_study_26.tar.xz"
PAGE = STUDIES.parent / "docs" / "results" / "blind_studies.md"


def main() -> None:
    """Pack, or write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    what = parser.add_subparsers(dest="what", required=True)
    pack = what.add_parser("pack")
    pack.add_argument("file", type=Path)
    pack.add_argument("folders", type=Path, nargs="+")
    what.add_parser("page")
    args = parser.parse_args()
    if args.what == "page":
        write_generated_part(PAGE, results_text(NEWEST))
        print(PAGE)
        return
    pack_studies([Study(folder) for folder in args.folders], args.file)
    print(f"{args.file}: {len(args.folders)} studies, {args.file.stat().st_size / 1e3:.0f} kB")


if __name__ == "__main__":
    main()
