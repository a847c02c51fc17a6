# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Write the generated part of docs/results/blind_studies.md from the newest study's archive."""

from pathlib import Path

from fish_study.results_page import results_text, write_generated_part

STUDIES = Path(__file__).parent

if __name__ == "__main__":
    page = STUDIES.parent / "docs" / "results" / "blind_studies.md"
    write_generated_part(page, results_text(STUDIES / "data" / "blind_study_26.tar.xz"))
    print(page)
