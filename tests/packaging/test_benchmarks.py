"""Benchmarks that need nothing beside the library run, with sizes at which their figures mean nothing."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]

SMALL = {
    "ensembles": ["--runs", "4", "--workers", "1"],
    "exact": ["--repeats", "1", "--event-horizon", "0.01", "--side", "120"],
    "heading_groups": ["--agents", "500", "--side", "5", "--updates", "5"],
    "hundred_million": ["--agents", "20000", "--steps", "2"],
    "imperfect_tiles": ["--agents", "1000", "--rounds", "1"],
    "pictures": ["--agents", "40", "--frames", "3", "--repeat", "1"],
    "replace_law": ["--agents", "40", "--repeat", "2"],
    "speed": ["--quick", "--largest", "1e4", "--only", "laws"],
}
"""Options of each benchmark with which it is over in seconds."""


@pytest.mark.parametrize("name", SMALL)
def test_a_benchmark_runs_to_its_end_and_prints_figures(name):
    script = ROOT / "benchmarks" / f"{name}.py"
    done = subprocess.run([sys.executable, str(script), *SMALL[name]], capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    assert any(character.isdigit() for character in done.stdout)
