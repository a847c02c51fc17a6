"""Progress on disk."""

import pytest

from fish_control.paths import make_path
from fish_control.progress_file import SavedProgress, load_progress, path_digest, save_progress


def test_what_is_saved_is_loaded(tmp_path):
    saved = SavedProgress("abc", 12.5, 1.25)
    save_progress(tmp_path / "p.json", saved)
    save_progress(tmp_path / "p.json", saved)
    assert load_progress(tmp_path / "p.json") == saved
    assert [file.name for file in tmp_path.iterdir()] == ["p.json"]


@pytest.mark.parametrize(
    "content",
    [
        "",
        "{",
        "[]",
        '{"path": "a"}',
        '{"path": "a", "time": "x", "progress": 1}',
        '{"path": "a", "time": 1, "progress": -1}',
    ],
)
def test_damaged_files_are_no_progress(tmp_path, content):
    (tmp_path / "p.json").write_text(content)
    assert load_progress(tmp_path / "p.json") is None


def test_no_file_is_no_progress(tmp_path):
    assert load_progress(tmp_path / "p.json") is None


def test_digest_tells_paths_apart():
    digests = {path_digest(make_path(name)) for name in "IROS"} | {path_digest(make_path("O", end="stop"))}
    assert len(digests) == 5
    assert path_digest(make_path("R")) == path_digest(make_path("letter", letter="R"))
