# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""JSON without what JSON has not."""

import json

import numpy as np

from fish_report.json_file import write_json


def test_what_is_not_finite_is_null_and_all_else_stays(tmp_path):
    content = {
        "a": [1, 2.5, np.float64(-np.inf), float("nan")],
        "b": np.array([[1.0, np.nan]]),
        "c": (True, None, "x", np.int64(3), np.bool_(True)),
        "d": {"e": -0.5},
    }
    write_json(tmp_path / "f.json", content)
    text = (tmp_path / "f.json").read_text()
    assert text.endswith("}\n")
    assert json.loads(text) == {
        "a": [1, 2.5, None, None],
        "b": [[1.0, None]],
        "c": [True, None, "x", 3, True],
        "d": {"e": -0.5},
    }
