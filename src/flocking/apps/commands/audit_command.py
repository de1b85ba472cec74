"""The command that judges claims, about saved runs and about samples from other programs."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from flocking.apps.json_output import print_json

if TYPE_CHECKING:
    from flocking.model.law import Scenario
    from flocking.study.claims.audit import Report
    from flocking.study.sample_files.sampled_runs import SampledMotion
    from flocking.study.sample_files.samples import Samples

Json = Annotated[bool, Parameter(name="--json")]

FINE, DIFFERENT = 0, 1
"""Exit codes: verdicts as expected, and not; of samples, which leave much open, whether a claim fails."""


MOST_NAMED = 20
"""Agents whose names are printed beside their numbers, a convention: as many as fit on a few lines."""

LONGEST_NAME = 60
"""Characters of the name of a column that are printed, a convention."""


def audit(
    source: Path,
    *,
    law: str | None = None,
    column: Annotated[list[str] | None, Parameter(name=["--column", "-c"])] = None,
    radius: float | None = None,
    time_step: float | None = None,
    replay: Annotated[bool, Parameter(negative="")] = False,
    html: Path | None = None,
    as_json: Json = False,
) -> int:
    """Judge claims about a saved run, or about a motion of which samples are in a file.

    Of a saved run those of its paper are judged, or the general ones; of samples without a law those that need none.

    Parameters
    ----------
    source
        Folder of a run; or a file of samples: .csv or .parquet (columns t, id, x, y, z and, if known, vx, vy, vz; one
        row per agent and time), .npz (arrays t, q and, if known, p), .gsd, or .mcap as 'flocking nodes' records it.
        Missing velocities are estimated.
    law
        The law that the samples are held against: a scenario as a TOML file, in which the start may be missing, or a
        name that 'flocking list' shows.
    column
        Name of a column or array in the file, as t=time; once for each.
    radius
        Radius within which agents are neighbours, for samples without a law.
    time_step
        Time of one step, for GSD files of other programs.
    replay
        Compute again what the agents of a saved run used when they acted, and the forces that follow, from its log.
    html
        Write a page too, one file: the law in symbols and words, each claim beside a picture of its evidence, what was
        guaranteed, and where the run comes from.
    as_json
        Print JSON.
    """
    from flocking.errors import InvalidInput

    if source.is_dir():
        for name, value in (("--law", law), ("--column", column), ("--radius", radius), ("--time-step", time_step)):
            if value is not None:
                raise InvalidInput(
                    "audit", name, "must be absent for a saved run", value, "It is for files of samples."
                )
        return _audit_run(source, html, as_json, replay)
    if replay:
        raise InvalidInput("audit", "--replay", "must be absent for samples", True, "Only saved runs have a log.")
    return _audit_samples(source, law, _named_columns(column or []), radius, time_step, html, as_json)


def _audit_run(folder: Path, html: Path | None, as_json: bool, replay: bool) -> int:
    from flocking.apps.commands.certify_command import certificate_rows, print_promises
    from flocking.apps.reproduction.run_page import write_run_page
    from flocking.engine.driver.waits import Wait, stage
    from flocking.engine.storage.stored_runs import read_run
    from flocking.papers.auditing import audit as audit_run
    from flocking.study.certificates.beside.guaranteed_claims import OTHER_RUN, WITH_GUARANTEE, guarantee_of
    from flocking.study.certificates.certify import certify
    from flocking.study.message_logs.replay import replay as replay_run

    with Wait("audit"):
        stage("reading the run")
        run = read_run(folder)
        stage("computing again what agents used" if replay else "judging claims")
        again = replay_run(run) if replay else None
        report = audit_run(run)
        scenario = report.run.scenario
        certificates = certify(scenario)
        stage("holding the run against its guarantees")
        other = run.fidelity.changed
        promised = [] if other else certificate_rows(report.run, certificates)
        broken = any(row["kept"] is False for row in promised)
        # A run that breaks a promise is not one of the declared scenario: of it nothing is guaranteed.
        shown = [r for r in report.results if r.verdict in WITH_GUARANTEE and not (broken or other)]
        proofs = {r.claim.key: guarantee_of(r.claim, certificates, scenario) for r in shown}
        proven = {key: proof.key for key, proof in proofs.items() if proof is not None}
        if html is not None:
            write_run_page(report, html, stated={"stored run": str(folder)}, source=folder.name)
    if as_json:
        found = {} if again is None else {"replay": again.as_dict()}
        print_json(report.as_dict() | {"certificates": promised, "guaranteed": proven} | found)
    else:
        _print_claims(report, scenario.name, proven)
        print_promises(promised)
        if other:
            print(OTHER_RUN)
        if broken:
            print("What is guaranteed of the scenario is broken: the run has another law, or was changed on its way.")
        print(_outcome(report))
        if again is not None:
            print(again)
        _tell_page(html)
    if again is not None and not again.agrees:
        return DIFFERENT
    return FINE if report.as_expected and all(row["kept"] is not False for row in promised) else DIFFERENT


def _outcome(report: Report) -> str:
    """Whether the claims of a run have the verdicts that were expected, in a sentence."""
    from flocking.study.claims.audit import DECIDED
    from flocking.study.claims.claim import Verdict

    unexpected = [r for r in report.results if r.verdict in DECIDED and not r.as_expected]
    if any(r.verdict is not Verdict.NOT_RESOLVED for r in unexpected):
        return "Some decided claims have another verdict than expected."
    found = "No decided claim has another verdict than expected"
    left = ", ".join(r.claim.key for r in unexpected)
    return f"{found}; not resolved, though a verdict was expected: {left}." if left else f"{found}."


def _audit_samples(
    path: Path, law: str | None, columns: dict[str, str], radius: float | None, time_step: float | None,
    html: Path | None, as_json: bool,
) -> int:  # fmt: skip
    from flocking.apps.tables import print_facts
    from flocking.engine.driver.waits import Wait, stage
    from flocking.errors import InvalidInput
    from flocking.papers.auditing import paper_claims
    from flocking.study.claims.audit import audit as audit_claims
    from flocking.study.claims.claim import Verdict
    from flocking.study.sample_files.reading import ENDINGS, read_samples
    from flocking.study.sample_files.sampled_runs import motion_of

    kinds = f"the folder of a saved run, or a file that ends in {', '.join(ENDINGS)}"
    if not path.exists():
        raise InvalidInput("audit", "source", f"must be {kinds}", str(path), "There is neither folder nor file.")
    if path.suffix.lower() not in ENDINGS:
        raise InvalidInput("audit", "source", f"must be {kinds}", str(path))
    with Wait("audit"):
        stage("reading the samples")
        samples = read_samples(path, columns=columns, time_step=time_step)
        scenario, begins = (None, None) if law is None else _law(law, samples)
        stage("estimating what the samples leave out")
        motion = motion_of(samples, scenario, radius=radius, begins=begins)
        claims = None if scenario is None else paper_claims(scenario.name)
        report = motion.audit() if claims is None else audit_claims(motion.run, claims)
        if html is not None:
            from flocking.apps.reproduction.run_page import write_run_page

            write_run_page(
                report, html, law_declared=law is not None, stated=_facts(path, samples, motion, law), source=path.name
            )
    if as_json:
        print_json({**report.as_dict(), **_facts(path, samples, motion, law)})
    else:
        print_facts(list(_facts(path, samples, motion, law).items()))
        print()
        _print_claims(report, "")
        verdicts = [str(r.verdict) for r in report.results]
        counts = {name: verdicts.count(name) for name in dict.fromkeys(verdicts)}
        print("; ".join(f"{count} {name}" for name, count in counts.items()) + ".")
        _tell_page(html)
    return DIFFERENT if any(r.verdict is Verdict.FAILS for r in report.results) else FINE


def _tell_page(html: Path | None) -> None:
    if html is not None:
        print(f"The page: {html}")


def _facts(path: Path, samples: Samples, motion: SampledMotion, law: str | None) -> dict[str, str]:
    """What the samples are, by name."""
    from flocking.formula.safe_digits import time_text

    t, q = samples.t, samples.q
    first, last = (time_text(time, t[0], t[-1], 6) for time in (t[0], t[-1]))
    unused = {"not read": _listed(samples.unused)} if samples.unused else {}
    return {
        "file": str(path),
        "agents": f"{q.shape[1]} in {q.shape[2]} dimension{'s' if q.shape[2] > 1 else ''}{_numbers(samples.names)}",
        "samples": f"{len(t)} from t = {first} to {last}",
        "velocities": str(motion.run.provenance["velocities"]),
        **unused,
        "law": law or "none declared: only claims that need none are judged",
    }


def _listed(names: tuple[str, ...]) -> str:
    """Names of columns or arrays of a file in a bounded text."""
    rest = f" and {len(names) - MOST_NAMED} more" if len(names) > MOST_NAMED else ""
    return ", ".join(repr(name[:LONGEST_NAME]) for name in names[:MOST_NAMED]) + rest


def _numbers(names: tuple[str, ...]) -> str:
    """Which number stands for which name of the file in what is printed; empty where names are these numbers."""
    if all(name == str(k) for k, name in enumerate(names)):
        return ""
    listed = ", ".join(f"{k} is {name!r}" for k, name in enumerate(names[:MOST_NAMED]))
    rest = f", and {len(names) - MOST_NAMED} more in the order of their lengths and letters"
    return f"; below they are numbered: {listed}{rest if len(names) > MOST_NAMED else ''}"


def _law(name: str, samples: Samples) -> tuple[Scenario, bool | None]:
    """The declared law; a file without a start gets that of the samples, which may be no start of the motion.

    The second is False for such a file, and else None: `motion_of` compares the start with the samples.
    """
    from flocking.apps.scenario_names import find_scenario, is_file
    from flocking.model.state import State
    from flocking.study.scenario_files.scenario_file import ScenarioFileError, read_scenario

    if not is_file(name):
        return find_scenario(name, None, None), None
    speeds = samples.q[0] * 0.0 if samples.p is None else samples.p[0]
    first = State(samples.q[0], speeds, float(samples.t[0]))
    try:
        return read_scenario(name), None
    except ScenarioFileError:
        # Without a start, or with faults, which are listed now.
        return read_scenario(name, start=first), False


def _named_columns(texts: list[str]) -> dict[str, str]:
    from flocking.errors import InvalidInput

    found: dict[str, str] = {}
    for text in texts:
        ours, equals, theirs = text.partition("=")
        if not (ours and equals and theirs) or ours in found:
            raise InvalidInput("audit", "--column", "must be t=NAME, id=NAME, x=NAME, ..., once for each", text)
        found[ours] = theirs
    return found


def _print_claims(report: Report, title: str, proven: Mapping[str, str] | None = None) -> None:
    """The claims with their verdicts, which of them certificates prove, and below the keys of these."""
    import shutil
    import textwrap

    from flocking.apps.tables import print_table, short

    sure = dict.fromkeys(proven or (), ", guaranteed")
    rows = [
        (r.claim.key, f"{r.verdict}{sure.get(r.claim.key, '')}", short(r.margin), short(r.error), r.words)
        for r in report.results
    ]
    print_table(("claim", "verdict", "margin", "error", "measured"), rows, title=title)
    if proven:
        known = [f"{key} ({proven[key]})" for key, *_ in rows if key in proven]
        text = f"Guaranteed before the run, each with its certificate: {', '.join(known)}."
        print(textwrap.fill(text, shutil.get_terminal_size().columns))
