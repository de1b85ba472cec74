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
    # Matplotlib and SymPy bring these; PIL is Pillow.
    brought = {"PIL", "cycler", "mpl_toolkits", "mpmath", "typing_extensions"}
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


def pythons() -> list[str]:
    """One Python of each version from 3.11 on that this machine has."""
    return subprocess.run([ROOT / ".ci" / "pythons"], capture_output=True, text=True, check=True).stdout.split()


def version_of(python: str) -> str:
    words = [python, "-c", "import sys; print('%d.%d' % sys.version_info[:2])"]
    return subprocess.run(words, capture_output=True, text=True, check=True).stdout.strip()


def call(folder: Path, *words: object, seconds: float = 900, **more: str) -> str:
    environment = {**os.environ, **more}
    shown = subprocess.run(
        list(map(str, words)), cwd=folder, capture_output=True, text=True, timeout=seconds, env=environment
    )
    assert shown.returncode == 0, shown.stdout[-6000:] + shown.stderr[-3000:]
    return shown.stdout


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the source tree, and in ``dist`` the wheel and the source distribution made of it."""
    folder = tmp_path_factory.mktemp("built")
    call(folder, sys.executable, "-m", "venv", "builder")
    call(folder, "builder/bin/python", "-m", "pip", "install", "-q", "hatchling")
    ignored = shutil.ignore_patterns(".venv*", "out", "__pycache__", ".*_cache", ".git", ".hypothesis")
    shutil.copytree(ROOT, folder / "source", ignore=ignored)
    call(folder / "source", folder / "builder/bin/hatchling", "build", "-d", folder / "dist")
    return folder


@pytest.mark.slow
def test_wheel_and_source_distribution_hold_the_same_package_and_install_anew(built: Path) -> None:
    (wheel,) = (built / "dist").glob("*.whl")
    (archive,) = (built / "dist").glob("*.tar.gz")
    # The page of the lab, fonts, tables of equations and stored studies belong to the package as its modules do.
    package = [p for p in (ROOT / "src" / "flocking").rglob("*") if p.is_file() and "__pycache__" not in p.parts]
    files = {p.relative_to(ROOT / "src").as_posix() for p in package}
    assert files <= set(zipfile.ZipFile(wheel).namelist())
    with tarfile.open(archive) as packed:
        names = {name.split("/", 1)[1] for name in packed.getnames() if "/" in name}
    assert {f"src/{name}" for name in files} <= names
    assert "pyproject.toml" in names
    call(built, "builder/bin/python", "-m", "pip", "wheel", "-q", "--no-deps", "-w", "again", archive)
    (again,) = (built / "again").glob("*.whl")
    assert files <= set(zipfile.ZipFile(again).namelist())


def installations() -> list[tuple[str, str]]:
    """What is installed on which Python: the wheel on each, the source distribution on the newest.

    ``FLOCKING_WHEEL_PYTHON`` names one version of Python, ``FLOCKING_WHEEL_FORM`` one of "wheel" and "sdist".
    """
    version, form = os.environ.get("FLOCKING_WHEEL_PYTHON"), os.environ.get("FLOCKING_WHEEL_FORM")
    found = [python for python in pythons() if not version or version_of(python) == version]
    every = [*(("wheel", python) for python in found), *(("sdist", python) for python in found[-1:])]
    assert every, f"there is no Python {version} here"
    return [(kind, python) for kind, python in every if not form or kind == form]


@pytest.mark.wheel
@pytest.mark.parametrize(("form", "python"), installations())
def test_the_wheel_and_the_source_distribution_are_installed_and_pass_the_quick_tests(
    built: Path, tmp_path: Path, form: str, python: str
) -> None:
    (package,) = (built / "dist").glob("*.whl" if form == "wheel" else "*.tar.gz")
    call(tmp_path, python, "-m", "venv", "clean")
    bin = tmp_path / "clean" / "bin"
    call(tmp_path, bin / "python", "-m", "pip", "install", "-q", "-c", ROOT / "requirements.txt", f"{package}[test]")
    assert call(tmp_path, bin / "flocking", "--version").strip() == PROJECT["version"]
    assert "zhou-2015" in call(tmp_path, bin / "flocking", "list")
    # The tests lie where the tree's own package is not on the path: they try what was installed. Those of the source
    # distribution are its own.
    tree = tmp_path / "tree"
    if form == "wheel":
        shutil.copytree(built / "source", tree, ignore=shutil.ignore_patterns("src"))
    else:
        with tarfile.open(package) as packed:
            packed.extractall(tmp_path / "unpacked", filter="data")
        (tmp_path / "unpacked" / package.name.removesuffix(".tar.gz")).rename(tree)
        shutil.rmtree(tree / "src")
    place = call(tree, bin / "python", "-c", "import flocking; print(flocking.__file__)").strip()
    assert place.startswith(str(tmp_path / "clean"))
    wanted = os.environ.get("FLOCKING_WHEEL_TESTS", "").split() or quick_tests()
    # What is written as it runs can be read before the end, which takes an hour and more.
    record = tmp_path / "quick_tests.txt"
    print(f"\n{form} on Python {version_of(python)}: {record}", flush=True)
    words = [bin / "python", "-m", "pytest", "-v", "-p", "no:xdist", "--durations=20", *wanted, *APART]
    with record.open("w") as out:
        ended = subprocess.run(words, cwd=tree, stdout=out, stderr=subprocess.STDOUT, timeout=LONGEST)
    shown = record.read_text()
    assert ended.returncode == 0, shown[-6000:]
    counted = re.search(r"=+ (.*\bpassed\b.*) =+$", shown.rstrip())
    assert counted is not None
    print(f"\n{form} on Python {version_of(python)}: {counted.group(1)}")


LONGEST = 6 * 3600
"""Seconds after which the quick tests of one installation are given up, by convention."""

APART = ("--deselect", "tests/test_floors.py::test_style_holds")
"""Style is that of lines of the source tree, which is not there; how imports are sorted depends on its place."""


def quick_tests() -> list[str]:
    """Files of `make test-quick`."""
    line = re.search(r"^QUICK := ((?:.*\\\n)*.*)$", (ROOT / "Makefile").read_text(), re.MULTILINE)
    assert line is not None
    return line.group(1).replace("\\\n", " ").split()
