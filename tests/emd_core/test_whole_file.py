"""Files that appear whole or not at all."""

import pytest

from emd_core.errors import InvalidInputError
from emd_core.whole_file import whole_file, write_text


def test_a_file_appears_whole_in_a_folder_made_for_it(tmp_path) -> None:
    """Nothing but the file is left."""
    write_text(tmp_path / "new" / "file.json", "{}")
    assert (tmp_path / "new" / "file.json").read_text() == "{}"
    assert [item.name for item in (tmp_path / "new").iterdir()] == ["file.json"]


def test_a_failure_leaves_the_older_file(tmp_path) -> None:
    """Neither a part of the new file nor a temporary one stays."""
    path = tmp_path / "file.txt"
    path.write_text("old")
    with pytest.raises(RuntimeError), whole_file(path) as temporary:
        temporary.write_text("half")
        raise RuntimeError
    assert path.read_text() == "old"
    assert [item.name for item in tmp_path.iterdir()] == ["file.txt"]


def test_a_place_that_takes_no_file_is_refused(tmp_path) -> None:
    """The error names the path."""
    (tmp_path / "file").write_text("")
    with pytest.raises(InvalidInputError, match=r"file/below\.txt"):
        write_text(tmp_path / "file" / "below.txt", "")
