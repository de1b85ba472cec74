"""A fresh clone sets itself up, and the built package installs and runs."""

from __future__ import annotations

import ast
import os
import re
import shutil
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]


def test_requirements_are_pinned_and_name_no_place() -> None:
    text = (ROOT / "requirements.txt").read_text()
    lines = text.splitlines()
    assert all(re.fullmatch(r"[a-z0-9._-]+==[A-Za-z0-9.+!]+( ; .+)?", line) for line in lines)
    assert not re.search(r"://|@|--|/", text)


def test_requirements_pin_everything_the_package_and_its_tests_need() -> None:
    pinned = {re.split(r"==", line)[0] for line in (ROOT / "requirements.txt").read_text().splitlines()}
    wanted = [*PROJECT["dependencies"], *PROJECT["optional-dependencies"]["test"]]
    names = {re.match(r"[A-Za-z0-9._-]+", text).group().lower() for text in wanted}  # type: ignore[union-attr]
    assert names <= pinned


MODULES = {"zenoh": "eclipse-zenoh"}
"""Modules whose package has another name."""


def test_every_import_of_the_package_is_a_declared_dependency() -> None:
    declared = {re.match(r"[A-Za-z0-9_-]+", d).group() for d in PROJECT["dependencies"]}  # type: ignore[union-attr]
    extras = {
        re.match(r"[A-Za-z0-9_-]+", d).group()  # type: ignore[union-attr]
        for found in PROJECT["optional-dependencies"].values()
        for d in found
    }
    # Matplotlib and SymPy bring these.
    brought = {"cycler", "mpl_toolkits", "mpmath", "typing_extensions"}
    given = declared | extras
    known = given | {name.replace("-", "_") for name in given} | brought | {"flocking"} | set(sys.stdlib_module_names)
    known |= {module for module, package in MODULES.items() if package in given}
    for path in (ROOT / "src").rglob("*.py"):
        assert imported(path) <= known, path


def imported(path: Path) -> set[str]:
    found = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            found |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            found.add(node.module.split(".")[0])
    return found


def test_the_gate_is_executable_and_calls_only_targets_that_exist() -> None:
    gate = ROOT / ".ci" / "run"
    assert os.access(gate, os.X_OK)
    text = gate.read_text()
    assert "set -euo pipefail" in text
    targets = set(re.findall(r"^make (\w+)", text, re.MULTILINE))
    assert "test" in targets
    assert targets <= set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(), re.MULTILINE))


def test_an_old_or_missing_python_is_told_in_plain_words(tmp_path: Path) -> None:
    old = tmp_path / "python-old"
    old.write_text("#!/bin/sh\n[ \"$1\" = --version ] && echo 'Python 3.8.1' && exit 0\nexit 1\n")
    old.chmod(0o755)
    for python, told in ((old, "Python 3.8.1"), (tmp_path / "absent", "not there")):
        command = ["make", "-C", str(ROOT), "setup", f"PYTHON={python}", f"VENV={tmp_path / 'venv'}"]
        shown = subprocess.run(command, capture_output=True, text=True, timeout=60)
        assert shown.returncode != 0
        assert "Python 3.11 or newer is needed" in shown.stdout
        assert told in shown.stdout
        assert not (tmp_path / "venv").exists()


@pytest.mark.slow
def test_wheel_and_source_distribution_hold_the_same_package_and_install_anew(tmp_path: Path) -> None:
    def call(*words: object, cwd: Path = tmp_path) -> str:
        shown = subprocess.run(list(map(str, words)), cwd=cwd, capture_output=True, text=True, timeout=900)
        assert shown.returncode == 0, shown.stdout + shown.stderr
        return shown.stdout

    call(sys.executable, "-m", "venv", "builder")
    call("builder/bin/python", "-m", "pip", "install", "-q", "hatchling")
    dist = tmp_path / "dist"
    source = tmp_path / "source"
    ignored = shutil.ignore_patterns(".venv", "out", "__pycache__", ".*_cache", ".git", ".hypothesis")
    shutil.copytree(ROOT, source, ignore=ignored)
    call(tmp_path / "builder/bin/hatchling", "build", "-d", dist, cwd=source)
    (wheel,) = dist.glob("*.whl")
    (archive,) = dist.glob("*.tar.gz")
    modules = {str(p.relative_to(ROOT / "src")) for p in (ROOT / "src" / "flocking").rglob("*.py")}
    assert modules <= set(zipfile.ZipFile(wheel).namelist())
    with tarfile.open(archive) as packed:
        names = {name.split("/", 1)[1] for name in packed.getnames() if "/" in name}
    assert {f"src/{name}" for name in modules} <= names
    assert "pyproject.toml" in names
    call("builder/bin/python", "-m", "pip", "wheel", "-q", "--no-deps", "-w", "again", archive)
    (again,) = (tmp_path / "again").glob("*.whl")
    assert modules <= set(zipfile.ZipFile(again).namelist())

    call(sys.executable, "-m", "venv", "clean")
    call("clean/bin/python", "-m", "pip", "install", "-q", "-c", ROOT / "requirements.txt", wheel)
    assert call("clean/bin/flocking", "--version").strip() == PROJECT["version"]
    assert "zhou-2015" in call("clean/bin/flocking", "list")
    place = call("clean/bin/python", "-c", "import flocking; print(flocking.__file__)").strip()
    assert place.startswith(str(tmp_path / "clean"))
