"""Files below folders: all of them, in folders within folders too, and through no link to a folder."""

from flocking.formula.listed_files import files_below


def test_files_in_folders_within_folders_are_listed_and_links_to_folders_are_not_followed(tmp_path):
    deep = tmp_path / "one" / "a" / "b"
    deep.mkdir(parents=True)
    other = tmp_path / "two"
    other.mkdir()
    for place in (tmp_path / "one" / "x.py", deep / "y.py", other / "z.py"):
        place.touch()
    (tmp_path / "one" / "link").symlink_to(other)
    found = sorted(entry.name for entry in files_below(tmp_path / "one", other, tmp_path / "missing"))
    assert found == ["link", "x.py", "y.py", "z.py"]
