# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The page of an identification: does the model swim as the fish did, and what is known about it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from fish_report.page import (
    Block,
    Table,
    Text,
    write_page,
)
from fish_sysid.dataset.read import heading
from fish_sysid.identification_result import Identification
from fish_sysid.reports.identify_page_figures import correlations, motion_figures, residual_figures
from fish_sysid.reports.identify_tables import (
    bias_table,
    entangled_table,
    error_table,
    noise_table,
    parameter_table,
)


def write_identify_page(path: Path, result: Identification, left_out: Sequence[str] = ()) -> None:
    """Write the self-contained page."""
    blocks: list[Block] = [Text("", text) for text in result.statements]
    blocks += [Text(heading(text), text) for text in left_out]
    where = "trials left out of the fit" if result.held_out else "trials that took part in the fit"
    tables = [error_table(result.errors, f"Prediction error on {where}"), parameter_table(result)]
    tables += [entangled_table(result), bias_table(result), noise_table(result)]
    blocks += [t for t in tables[:1] if t.rows]
    blocks += motion_figures(result)
    blocks += [t for t in tables[1:] if _has_rows(t)]
    blocks.append(correlations(result))
    blocks += residual_figures(result)
    held = result.held_out.names if result.held_out else ()
    lead = f"Fitted to {', '.join(result.training.names)} in {result.seconds:.0f} s; left out: {', '.join(held) or 'none'}."
    write_page(path, f"Identification of {result.start.name}", lead, blocks)


def _has_rows(table: Table) -> bool:
    return bool(table.rows)
