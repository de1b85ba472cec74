"""Repetitions of tests count what fails, keep the load, and end."""

from __future__ import annotations

from pathlib import Path

from tests.repeat import repeated

SOMETIMES = """
from pathlib import Path

def test_fails_in_all_but_the_first():
    # Only one process makes the folder.
    Path(__file__).with_name("made").mkdir()

def test_passes():
    pass
"""


def test_a_test_that_fails_sometimes_is_counted(tmp_path: Path) -> None:
    file = tmp_path / "test_sometimes.py"
    file.write_text(SOMETIMES)
    tests = ["--rootdir", str(tmp_path), "-c", "/dev/null", "-p", "no:cacheprovider", str(file)]
    failed = repeated(tests, times=3, load=2, logs=tmp_path / "logs")
    assert [(name.split("::")[-1], count) for name, count in failed.items()] == [("test_fails_in_all_but_the_first", 2)]
    assert len(list((tmp_path / "logs").iterdir())) == 3


def test_tests_that_cannot_run_are_counted(tmp_path: Path) -> None:
    (name,) = repeated([str(tmp_path / "absent.py")], times=1, load=1, logs=tmp_path / "logs")
    assert "exit code 4" in name
