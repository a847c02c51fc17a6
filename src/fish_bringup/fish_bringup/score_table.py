# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The tables of a scored run, for the terminal and for the page: the same cells in both."""

from __future__ import annotations

import numpy as np

from fish_bringup.score import RunScore, Summary
from fish_report.page import Table


def error_table(score: RunScore) -> Table:
    """RMSE, 95th percentile and maximum of every error, with and without the approach phase."""
    whole, settled = score.summaries(with_approach=True), score.summaries(with_approach=False)
    rows = [[name, *_cells(settled[name]), *_cells(whole[name])] for name in whole]
    header = ["error", "RMSE", "95 %", "max", "RMSE *", "95 % *", "max *"]
    approach = "never ended" if np.isnan(score.approach_s) else f"took {score.approach_s:.1f} s"
    note = f"Without the approach phase, which {approach}; * with it. Heading: mean over a stroke of the tail."
    if not (score.finished or score.path.closed):
        note += (
            f" The run ended at {score.progress[-1]:.2f} m of a path of {score.path.length:.2f} m."
        )
    return Table("Tracking errors", header, rows, note)


def _cells(summary: Summary) -> list[str]:
    sizes = (summary.rmse, summary.p95, summary.maximum)
    return [f"{value:.4f}" if np.isfinite(value) else "-" for value in sizes]
