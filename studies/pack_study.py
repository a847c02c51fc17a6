# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Pack finished studies into one file: python studies/pack_study.py FILE.tar.xz FOLDER [FOLDER ...]."""

import sys
from pathlib import Path

from fish_study.study import Study, pack_studies

if __name__ == "__main__":
    if len(sys.argv) < 3:
        sys.exit(__doc__)
    file, *folders = map(Path, sys.argv[1:])
    pack_studies([Study(folder) for folder in folders], file)
    print(f"{file}: {len(folders)} studies, {file.stat().st_size / 1e3:.0f} kB")
