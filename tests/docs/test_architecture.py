"""The page on the architecture draws every folder, and the table of tasks leads to the right file for each of them."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
SOURCE = ROOT / "src" / "flocking"
PAGE = (ROOT / "ARCHITECTURE.md").read_text(encoding="utf-8")
TASKS = (ROOT / "docs" / "where_to_change.md").read_text(encoding="utf-8")
INSIDE = (ROOT / "docs" / "inside.md").read_text(encoding="utf-8")
ROWS = dict(re.findall(r"^\| (.+?) \| `([^`]+)` \|$", TASKS, re.MULTILINE))
MOST_LINES = 72
"""Lines of a printed page."""
ENGINES = ("exact", "sampled", "delayed", "discrete", "tiles", "lammps")

HOMES = {
    "change which laws a paper's claims are about": "def of_stated_law(",
    "change what agents know of leaders by messages": "class LeaderNews",
    "change how large groups log what they used": "class UsedSamples",
    "change how large groups know leaders by messages": "class KnownLeaders",
    "change what departs of agents of order 1 under held control in large groups": "def departure_kernel(",
    "change which samples of leaders agents use under continuous control": "class LeaderSamples",
    "change how it is located when agents of similar headings come near under held control": "class ConeView",
    "change what a replaced law or state changes under delayed knowledge": "class Replacement",
    "change what a replaced law or state changes with messages under continuous control": "def _go_on_with(",
    "change when agents know of a replaced state": "class StateJumps",
    "change what goes with an agent that changes ranks under held control": "class HeldRankParticles(",
    "change what goes with a body that changes ranks under held control": "def columns_here(self",
    "change which rank writes which agents of a frame": "class FrameShares",
    "change how costly a formula may be": "def excess(",
    "allow another function in text formulas": "FUNCTIONS: dict[str, int] = {",
    "change the size limit of the cache of generated code": "MOST_BYTES =",
    "add a term that acts between pairs": "class PairTerm(",
    "change how an alignment weight falls with the distance": "class CuckerSmale(",
    "change the body term that follows a leader": "class Track(",
    "change what beta- and gamma-agents do": "class Avoid(",
    "add a body": "class PointMass(",
    "change how robots on wheels follow the law": "class Unicycle(",
    "change how large groups of headings are updated": "def turn(",
    "change how bands of large groups are measured": "def waves_of(",
    "change what is stored of the transition in large groups": "class Study:",
    "certify what lost messages do to a lattice": "class LossyLattice:",
    "change how kernels are given to threads": "class Workers:",
    "change how the native loop hears messages under held control": "def hear(",
    "change how a safety filter changes forces": "class ForceFilter:",
    "change how bodies without a closed form move between ticks": "class IntegratedMotion(",
    "change how bodies without a closed form are integrated again": "class IntegratedForcedMotion",
    "change what departed energy is split into": "CAUSES =",
    "change how differences of forces are integrated along a motion": "class Works",
    "change how bodies with ideal knowledge are integrated again": "class IdealMotion",
    "change how imperfect knowledge is switched off at the acts of a log": "def act_differences(",
    "change how imperfect knowledge is switched off under continuous control": "class KnowledgeDifferences",
    "change what each part of a body does to forces": "class BodyShares",
    "change what departed energy of delayed knowledge is due to": "class DelayedCauses(",
    "change how it is located when agents come into view under held control and with messages": "def find_view_events(",
    "change how it is located when agents come into view of those whose headings turn": "def find_turning_events(",
    "change how agents keep their stopping paths apart": "def between(",
    "add a guarantee of consensus on graphs that switch": "def switching_certificates(",
    "add a guarantee of consensus on directed graphs": "def directed_certificates(",
    "add a guarantee of the linearisation at an equilibrium": "def equilibrium_certificates(",
    "add a guarantee about the centre of mass and its leader": "def leader_error_certificates(",
    "add a guarantee about obstacles of the law": "def obstacle_certificates(",
    "say which certificate proves a claim": "PROVEN_BY",
    "add a guarantee of a safety filter": "def safety_certificates(",
    "add a steering term": "class Separation(",
    "change how a vehicle follows a desired velocity": "class VelocityUnit(",
    "change what agents know by position fixes": "class Fixes(",
    "change how headings are set at ticks": "class Heading(",
    "change how neighbours are found in discrete time": "class CellPairs:",
    "add an actuator or a limit": "class Limited(",
    "change how it is located when a limit begins to act": "def first_limit_change(",
    "add a space": "class Open",
    "change which images the exact engine watches": "def reachable(",
    "change the displacements that kernels compute": "def displacement_lines(",
    "change the printed source of the equations of motion": "def motion_source(",
    "change the formulas for the flow of agents of order 1": "def flow_formulas(",
    "let the engines with a fixed step move another body": "STRUCTURES =",
    "say which bodies held forces allow": "def check_bodies(",
    "change what bodies make of controls in large groups": "def body_motion(",
    "change what bodies make of held forces in large groups": "class HeldActuation",
    "add a graph with another link rule": "class Graph(",
    "add a bump function": "class Bump",
    "add a shape of obstacle": "class Obstacle(",
    "add a random start": "def box(",
    "change how the forces of a law are printed as code": "def _control_source(",
    "let native functions use another operation": "_KNOWN: dict[",
    "change the relative tolerance of the exact engine's integration method": "RELATIVE =",
    "change how a crossing of a distance is located": "def crossings(",
    "change which pairs the native loop looks at": "def require_pairs(",
    "change which switches the native loop applies by itself": "def judge_switches(",
    "change how pairs that act on each other are computed": "def mutual_loop(",
    "change the companion solution that estimates the integration error": "class Companion",
    "change how the error of a motion is estimated by repetitions": "def repetitions_of",
    "change how groups of several bodies are made": "class Mixture(",
    "change what bodies make of held forces": "class Actuation",
    "change what a largest speed makes of held forces": "def fit_speed(",
    "change when agents meet obstacles under messages or delays": "class ObstacleRanges",
    "add a field to the checkpoint of the exact engine": "def pack_exact(",
    "add a column to the ledger of a run": "TRACE_FIELDS =",
    "change how the controller of one agent is called": "class Controller:",
    "change what an agent in a process of its own does": "class PythonNode(",
    "change what happens when an agent does not answer": "class NodeSession(",
    "change how a formula is written in C": "class CSource:",
    "write another steering term in C": "_WRITERS",
    "change the safety filter of exported C": "def safety_source(",
    "add an elementary function to exported C": "def elementary_functions(",
    "change which samples an exported law keeps when it hears too many": "def message_source(",
    "change how an exported law stores links": "def memory_source(",
    "change how arguments of a controller are checked": "def time_stamps(",
    "change the automatic time step": "def largest_step(",
    "add an integrator with a fixed step": "class Verlet(",
    "change the skin rule": "def best_skin(",
    "change how neighbour lists are built": "class ListBuilder",
    "change the kernel of one time step": "def tile_kernels(",
    "change how forces are held in large groups": "class HeldTilesSession",
    "change how messages reach agents in large groups": "def search",
    "change the accuracy of the inverse square root": "inverse_root = ",
    "change the LAMMPS input deck": "def make_deck(",
    "change how agents change ranks": "def exchanged(",
    "change the messages between ranks in a step": "def refresh(",
    "change what ranks decide together": "class SharedParticles",
    "change how a file survives a kill": "os.replace(",
    "change what of a killed process is removed": "def _is_abandoned(",
    "export runs to another format": "def export_run(",
    "change how often a running session is committed to disk": "COMMIT_SECONDS =",
    "change the progress lines": "LINE_SECONDS =",
    "change how many scenarios run in the threads of a process": "def simulate_many(",
    "add a claim about links for any law": "def stays_connected(",
    "add a guarantee that follows from the energy": "def energy_certificates(",
    "change the verdict over several seeds": "class Judgement",
    "change the properties that a potential is checked for": "class Properties:",
    "add a kind of value for files, editors and the lab": "class Value",
    "change what an annotation of a part's field means": "def _held(",
    "change how quadrotors turn": "class Quadrotor(",
    "change what is logged when agents act": "class MessageLog",
    "change how the log of messages is computed again": "def _expected(",
    "change how the log of messages under continuous control is computed again": "class ContinuousReplay(",
    "change how known links of delayed knowledge are computed again": "class DelayedReplay",
    "add a quantity whose margin is sought": "class Quantity:",
    "change what stored tables of margins are computed from": "PLANS",
    "change what may be changed while held control runs": "def check_information",
    "change how Ctrl-C reaches a wait for workers": "def first_of(",
    "change when the runs of a dead worker are scheduled again": "class Scheduler",
    "add a guarantee of velocity alignment": "def alignment_certificates(",
    "change how velocities of samples are estimated": "def smoothed_velocities",
    "change which samples count as jumps of positions": "def largest_jump",
    "change the colours of pictures": "class Theme",
    "correct the reading of an equation of Zhou": "[[statement]]",
    "add a field to the description of every paper, such as its venue": "class Paper:",
    "give an array type a name": "Numbers32 =",
    "add an option to `flocking run`": "def run(",
    "change the layout of the report": "def write_report(",
    "change the page about one run": "def write_run_page",
    "set another command of LaTeX": "ACCENTS = ",
    "change how a law is written in symbols": "def law_latex",
    "change which names in sentences are variables": "ARTICLES = ",
    "change the colour of a verdict beside the measures in the lab": "class ShownVerdict",
    "change which requests the lab refuses": "class AccessCheck",
    "add a challenge to the lab": "class Challenge",
    "add a request that a page of the lab can send": "class Orders",
    "change what the timeline of the lab stores": "class Timeline",
    "change which potentials the lab refuses": "def check_range",
    "change what a frame carries to a page of the lab": "def packed",
    "change how obstacles are drawn in the lab": "def solids(",
    "change the port on which the lab listens": "PORT =",
    "change the exit codes of commands": "BAD_INPUT",
    "add a column to `flocking equations`": "def equations(",
    "change what happens on Ctrl-C": "def check(",
    "refuse a damaged checkpoint by another rule": "class Form(",
    "change what messages under continuous control do at an instant": "def hear(self, instant",
    "change what agents know between two messages under continuous control": "class MessageStates(",
    "change how the past of delayed agents is kept": "class History:",
    "change when agents that know themselves late meet obstacles": "class MetObstacles:",
    "change what agents read of the past where every pair has its delay": "def fill_states(",
    "change how bodies move under the forces of late knowledge": "class DelayedLaw(",
    "change where steps end because of a delay": "class BreakingPoints(",
    "change how switches of links under messages or delays are located": "def add_switches(",
    "change how parameters are handed to the kernels of large groups": "class LawParameters:",
    "change how a controller links the agents of which it has samples": "def find_linked(",
    "add a stored study of a paper": "STUDIES = {",
    "add a showcase": "SHOWCASES = {",
    "change how ground and verdict of a paper's claim go together": "def claims_by_name(",
    "change when a net counts as rigid": "def is_rigid(",
    "add a guarantee under late samples": "class NeighboursLate:",
    "change how a fault of a scenario file is worded": "def problem_of(",
    "add a deliberately wrong plant": "def flipped_sign(",
}
"""For each task, words that stand where it is done."""


def test_there_are_at_least_thirty_tasks_on_the_page():
    assert set(ROWS) == set(HOMES)
    assert len(HOMES) >= 30


@pytest.mark.parametrize("task", HOMES)
def test_a_task_is_done_in_the_file_that_the_page_names(task):
    path = SOURCE / ROWS[task]
    assert path.is_file()
    assert HOMES[task] in path.read_text(encoding="utf-8")


def test_every_folder_has_a_task():
    """But folders of papers, of which one stands for all, and of data."""
    papers = {p.parent for p in SOURCE.glob("papers/*/equations.toml")}
    named = {(SOURCE / name).parent for name in ROWS.values()}
    folders = {p.parent for p in SOURCE.rglob("*.py") if p.name != "__init__.py"}
    assert folders - papers - named == set()
    assert named & papers


def test_the_plan_names_every_folder():
    plan = PAGE.split("```text")[1].split("```")[0]
    named = set(re.findall(r"([a-z_0-9]+)/", plan))
    papers = {p.parent.name for p in SOURCE.glob("papers/*/equations.toml")}
    folders = {p.parent.name for p in SOURCE.rglob("*.py")} - {"flocking"} - papers
    assert folders - named == set()
    assert named - folders == {"src", "flocking"}


def test_the_plan_is_one_figure_on_one_page():
    assert PAGE.count("```text") == PAGE.count("```") // 2 == 1
    assert len(PAGE.splitlines()) <= MOST_LINES


def test_files_named_in_the_text_are_there():
    text = INSIDE.split("## How it works")[1]
    names = re.findall(r"`([a-z_/]+\.py)`", text)
    assert len(names) > 30
    for name in names:
        assert [p for p in SOURCE.rglob(Path(name).name) if p.as_posix().endswith(f"/{name}")], name


def engines_named(text: str) -> set[str]:
    """Names of engines among the texts of a file, docstrings apart."""
    values = {node.value for node in ast.walk(ast.parse(text)) if isinstance(node, ast.Constant)}
    return {name for name in ENGINES if name in values}


def test_no_file_of_the_study_names_an_engine():
    """What the page says of the account that a run has of its fidelity."""
    assert "No file of `study/` names an\nengine" in INSIDE
    found = {path.name: engines_named(path.read_text()) for path in (SOURCE / "study").rglob("*.py")}
    assert {name: engines for name, engines in found.items() if engines} == {}
    assert engines_named('"""The exact engine."""\nif run.fidelity.engine == "exact":\n    pass\n') == {"exact"}
