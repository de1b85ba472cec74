"""Exported laws of single precision on an emulated Cortex-M4F, against the same source on this machine."""

import subprocess

import numpy as np
import pytest

import flocking as fk
from flocking.papers import keys, paper
from tests.engine.c_export.building import CODES, CompiledLaw, needs_compiler
from tests.engine.c_export.emulating import Emulated
from tests.engine.c_export.filtering import called, crowd, filtered_scenario
from tests.engine.c_export.judging import random_surroundings
from tests.engine.c_export.test_on_this_machine import LAW, scenario_of

pytestmark = [pytest.mark.emulator, needs_compiler]
NAMES = [
    "zhou-2015-leader",
    "shi-2009",
    "olfati-saber-2003",
    "olfati-saber-2006-space",
    "tanner-2003-fixed",
    "cucker-smale-2007",
    "vicsek-1995",
    "reynolds-1987",
    "vasarhelyi-2018-obstacles",
]
SCENARIOS = {name: make for key in keys() for name, make in paper(key).scenarios().items() if name in NAMES}


def both(folder, scenario, **options):
    folders = [folder / "here", folder / "there"]
    for each in folders:
        each.mkdir()
    return CompiledLaw(folders[0], scenario, float32=True, **options), Emulated(folders[1], scenario, **options)


@pytest.mark.parametrize("name", NAMES)
def test_bits_are_equal(name, tmp_path):
    scenario = SCENARIOS[name](0)
    here, there = both(tmp_path, scenario, neighbours=8)
    rng, forces = np.random.default_rng(7), 0
    for _ in range(200):
        agent, q, p, others = random_surroundings(rng, scenario, most=8)
        now = int(rng.integers(0, 10**10))
        memories = [each.begin(agent) for each in (here, there)]
        for j, (x, v) in others.items():
            assert [e.receive(m, j, x, v, stamp=now) for e, m in zip((here, there), memories, strict=True)] == [0, 0]
        results = [e.control(m, q, p, now) for e, m in zip((here, there), memories, strict=True)]
        assert results[0][0] == results[1][0]
        assert results[0][1].tobytes() == results[1][1].tobytes()
        forces += bool(results[0][1].any())
    assert forces > 50


@pytest.mark.parametrize("form", ["sampled", "continuous", "stopping"])
def test_bits_of_a_safety_filter_are_equal(form, tmp_path, capsys):
    """In random crowds, two ticks each; the most instructions of a call are for the docs."""
    obstacles = (fk.Ball([2.0, 2.0], 0.5), fk.Wall([0.0, -3.0], [0.0, 1.0])) if form == "stopping" else ()
    scenario = filtered_scenario(form, 9, obstacles=obstacles)
    here, there = both(tmp_path, scenario)
    rng, changed, counts = np.random.default_rng(3), 0, {False: [0], True: [0]}
    for _ in range(30):
        (q, p), agent = crowd(rng, 9, 2), int(rng.integers(9))
        heard = [j for j in range(9) if j != agent]
        memories = [each.begin(agent) for each in (here, there)]
        for number in range(2):
            found = [called(e, m, agent, q, p, heard, number) for e, m in zip((here, there), memories, strict=True)]
            assert found[0][0] == found[1][0]
            assert found[0][1].tobytes() == found[1][1].tobytes()
            changed += memories[0].filtered
            counts[bool(memories[0].relaxed)].append(there.instructions)
            q = q + 0.05 * p
    assert changed > 20
    with capsys.disabled():
        print(f"\n| {form} | {max(counts[False]):,} | {max(counts[True]):,} |")


def test_thresholds_expiry_and_nan(tmp_path):
    """Links cross both distances, a neighbour expires, a number is none: the same codes, links and bits."""
    information = fk.Messages(0.1, expires=0.5, predict=True)
    scenario = scenario_of(LAW, 3, information=information, control=fk.Held(0.1))
    pair = both(tmp_path, scenario)
    memories, seen = [each.begin(0) for each in pair], []
    steps = [3.8, 3.9, 4.1, 3.8, 3.4, 3.8, None, None, 3.8, 3.4, float("nan"), 3.5, 3.49999, 3.99999, 4.0, 0.0]
    for k, distance in enumerate(steps):
        now, found = k * 250_000_000, []
        for each, memory in zip(pair, memories, strict=True):
            heard = None
            if distance is not None:
                heard = each.receive(memory, 1, [distance, 0.0], [0.25, 0.0], number=k, stamp=now)
            code, u = each.control(memory, [0.0, 0.0], [0.0, 0.0], now)
            found.append((heard, code, each.links(memory), u.tobytes()))
        assert found[0] == found[1]
        seen.append(found[0][:3])
    ok, nan, coincident = CODES["OK"], CODES["NOT_FINITE"], CODES["COINCIDENT"]
    assert [links for _, _, links in seen] == [
        [1], [1], [], [], [1], [1], [1], [], [], [1], [1], [1], [1], [1], [], [],
    ]  # fmt: skip
    assert [code for _, code, _ in seen] == [ok] * 15 + [coincident]
    assert seen[10][0] == nan
    for each, memory in zip(pair, memories, strict=True):
        code, u = each.control(memory, [0.0, 0.0], [float("nan"), 0.0], len(steps) * 250_000_000)
        assert (code, u.tolist()) == (nan, [0.0, 0.0])


def test_instructions_for_the_numbers_of_neighbours(tmp_path, capsys):
    """Counts for 1 to 32 neighbours, all linked; they grow by the same for each, and print the table of the docs."""
    rows, rng = {}, np.random.default_rng(2)
    for name in ("zhou-2015-leader", "olfati-saber-2006", "shi-2009"):
        scenario = next(make for key in keys() for n, make in paper(key).scenarios().items() if n == name)(0)
        radius = float(np.max(scenario.law.graph.break_radius))
        law = scenario.law
        start = fk.State(rng.normal(size=(33, 2)), np.zeros((33, 2)))
        wide = _for_agents(scenario, law, start)
        folder = tmp_path / name
        folder.mkdir()
        emulated = Emulated(folder, wide)
        counts = {}
        for k in (1, 2, 4, 8, 16, 32):
            emulated.begin(0)
            for j in range(1, k + 1):
                angle = 2 * np.pi * j / 32
                assert (
                    emulated.receive(None, j, radius * 0.6 * np.array([np.cos(angle), np.sin(angle)]), [0.1, 0.2]) == 0
                )
            code, _ = emulated.control(None, [0.0, 0.0], [0.0, 0.0])
            assert code == 0
            counts[k] = emulated.instructions
        rows[name] = counts
        each = [(counts[b] - counts[a]) / (b - a) for a, b in ((1, 2), (8, 16), (16, 32))]
        assert max(each) < 1.5 * min(each)
    with capsys.disabled():
        print()
        for name, counts in rows.items():
            print(f"| `{name}` | " + " | ".join(f"{x:,}" for x in counts.values()) + " |")


def _for_agents(scenario, law, start):
    """The law for as many agents as a start has."""
    terms = []
    for term in law.terms:
        weights = getattr(term, "weights", None)
        gain = getattr(term, "velocity_gain", None)
        if np.ndim(gain):
            term = type(term)(**{**{f: getattr(term, f) for f in term.__dataclass_fields__}, "velocity_gain": 1.0})
        if weights is not None:
            term = fk.Consensus(term.gain, weights=fk.HashedWeights(0.1, 1.0, 3))
        terms.append(term)
    return fk.Scenario(fk.Law(law.graph, terms), start, 1.0)


@pytest.mark.parametrize("float32", [False, True])
def test_cppcheck_finds_nothing(float32, tmp_path):
    for name, make in SCENARIOS.items():
        fk.export_c(make(0), tmp_path / name, float32=float32, neighbours=8, limit=5.0)
    for form in ("sampled", "continuous", "stopping"):
        fk.export_c(filtered_scenario(form), tmp_path / form, float32=float32)
    rules = ["--std=c99", "--enable=warning,style,performance,portability", "--inconclusive", "--error-exitcode=2"]
    found = subprocess.run(["cppcheck", "-q", *rules, str(tmp_path)], capture_output=True, text=True)
    assert (found.returncode, found.stderr) == (0, "")


def test_the_cmake_file_builds(tmp_path):
    fk.export_c(SCENARIOS["shi-2009"](0), tmp_path / "law", neighbours=8)
    for command in (["-S", str(tmp_path / "law"), "-B", str(tmp_path / "out")], ["--build", str(tmp_path / "out")]):
        subprocess.run(["cmake", *command], check=True, capture_output=True)
    assert (tmp_path / "out" / "law_example").exists()
