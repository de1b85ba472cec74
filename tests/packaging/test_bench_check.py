"""`make bench-check` fails on an engine that has become slower, and on nothing that it does not know."""

from __future__ import annotations

import importlib.util
import json
from pathlib import Path
from types import ModuleType

import pytest
from llvmlite import binding

from flocking.engine.tiles.particles.particle_arrays import ParticleArrays

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(name="check", scope="module")
def loaded() -> ModuleType:
    spec = importlib.util.spec_from_file_location("bench_check", ROOT / "benchmarks" / "check.py")
    assert spec
    assert spec.loader
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_a_slowed_engine_fails_the_check(check, tmp_path, monkeypatch, capsys):
    def rows():
        yield "steps", check.steps(check.tiles(*check.neighbours(2, 3000)), 10), check.numpy_work

    file = tmp_path / "ratios.json"
    options = ["--file", str(file), "--rounds", "5"]
    assert check.main([*options, "--store"], rows) == 0
    stored = json.loads(file.read_text())
    assert list(stored) == [binding.get_host_cpu_name()]
    move = ParticleArrays.move

    def three_times(self, *given, **named):
        for _ in range(3):
            move(self, *given, **named)

    monkeypatch.setattr(ParticleArrays, "move", three_times)
    assert check.main(options, rows) == 1
    assert "SLOWER" in capsys.readouterr().out
    assert json.loads(file.read_text()) == stored


def test_ratios_are_judged_by_fifteen_per_cent(check, capsys):
    known = {"one": 2.0, "two": 0.5}
    assert check.check({"one": 2.29, "two": 0.1}, known) == []
    assert check.check({"one": 2.31, "two": 0.1}, known) == ["one"]
    assert check.check({"three": 0.1}, known) == ["three"]
    assert "UNKNOWN" in capsys.readouterr().out


def test_another_processor_is_not_compared(check, tmp_path, capsys):
    file = tmp_path / "ratios.json"
    file.write_text(json.dumps({"some other": {"steps": 1.0}}))
    assert check.main(["--file", str(file)], lambda: iter(())) == 2
    assert "No ratios are stored" in capsys.readouterr().out


def test_the_stored_ratios_are_those_of_the_rows_measured(check):
    source = (ROOT / "benchmarks" / "check.py").read_text()
    for ratios in json.loads(check.STORED.read_text()).values():
        assert len(ratios) == source.count("    yield ")
        assert all(f'yield "{name}"' in source for name in ratios)
        assert all(value > 0.0 for value in ratios.values())
