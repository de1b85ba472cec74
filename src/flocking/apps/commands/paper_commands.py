"""Commands about the papers: their scenarios, their reproduction, their equations, and schemas for editors."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from flocking.apps.json_output import print_json

Json = Annotated[bool, Parameter(name="--json")]

FINE, DIFFERENT = 0, 1
"""Exit codes, see `flocking.apps.cli`."""


def list_scenarios(*, as_json: Json = False) -> int:
    """List the scenarios of the papers, and the large ones of the gallery.

    Parameters
    ----------
    as_json
        Print JSON.
    """
    from flocking.apps.scenario_names import paper_scenarios
    from flocking.apps.tables import print_table
    from flocking.papers import paper
    from flocking.papers.olfati_saber_2003.system import KEY as LARGE_KEY
    from flocking.papers.showcases.files import TITLES

    rows = [
        {"scenario": name, "paper": key, "title": paper(key).title_of(name)}
        for name, (key, _) in paper_scenarios().items()
    ]
    rows += [{"scenario": name, "paper": LARGE_KEY, "title": f"Large: {title}"} for name, title in TITLES.items()]
    if as_json:
        print_json(rows)
    else:
        print_table(("scenario", "paper", "title"), [tuple(row.values()) for row in rows])
    return FINE


def reproduce(
    *papers: str,
    every: Annotated[bool, Parameter(name="--all", negative="")] = False,
    seeds: int = 10,
    first_seed: int = 0,
    out: Path | None = None,
    workers: int | None = None,
    as_json: Json = False,
) -> int:
    """Reproduce papers: run their scenarios, judge their claims, draw their figures.

    Parameters
    ----------
    papers
        Keys of papers; when absent, those of the five that the library began with, and papers of other packages.
    every
        Reproduce the further standard laws of the literature too.
    seeds
        Number of seeds per scenario. A verdict needs five that meet the claim's hypothesis: with five or more, further
        ones are drawn until there are.
    first_seed
        The first seed; the others follow one by one.
    out
        Folder for report.html, claims.json, errata.json, figures and films; nothing is written when absent.
    workers
        Processes; the number of cores when absent.
    as_json
        Print JSON.
    """
    from flocking.apps.reproduction.reproduce import reproduce as reproduce_papers
    from flocking.apps.reproduction.results import rate_of
    from flocking.apps.tables import print_table, short
    from flocking.errors import InvalidInput
    from flocking.papers import default_keys, keys
    from flocking.study.claims.judgement import FEWEST_SEEDS

    if papers and every:
        raise InvalidInput("reproduce", "--all", "must stand alone", " ".join(papers), "Leave out the keys.")
    found = reproduce_papers(
        tuple(dict.fromkeys(papers)) or (keys() if every else default_keys()),
        seeds=seeds,
        first_seed=first_seed,
        out=out,
        workers=workers,
        progress=True,
    )
    if as_json:
        print_json(
            {
                "as_expected": found.as_expected,
                "seconds": found.seconds,
                "claims": found.as_list(),
                "errata": found.errata,
                "figures": [str(path) for path in found.figures],
            }
        )
    else:
        for name, judgements in found.judgements.items():
            rows = [
                (
                    "" if j.as_expected else "!",
                    j.claim.key,
                    str(j.verdict),
                    "" if j.as_expected else j.claim.expectation,
                    f"{j.held}/{j.met}/{j.tried}",
                    rate_of(j),
                    short(j.worst.margin),
                )
                for j in judgements
            ]
            print_table(
                ("", "claim", "verdict", "expected", "held/met/seeds", "rate, 95 %", "worst margin"), rows, title=name
            )
            print()
        where = f", {len(found.figures)} figure files in {out}" if out else ""
        print(
            f"{found.expected - found.unexpected} of {found.expected} claims with an expected verdict have it, in "
            f"{found.seconds:.0f} s{where}."
        )
        if found.observed:
            print(f"{found.observed} further claims are observations: they have rates and no expected verdict.")
        for sentence in found.left_open:
            print(sentence)
        if seeds < FEWEST_SEEDS:
            print(f"Use at least {FEWEST_SEEDS} seeds.")
        if out is not None:
            print(f"Open {out / 'report.html'}")
    return FINE if found.as_expected else DIFFERENT


def equations(*papers: str, as_json: Json = False) -> int:
    """Show how every numbered statement of the papers is read, and which are wrong as printed.

    Parameters
    ----------
    papers
        Keys of papers; all when absent.
    as_json
        Print JSON.
    """
    from flocking.apps.tables import print_table
    from flocking.engine.driver.waits import Wait, stage
    from flocking.papers.tables import equation_table

    with Wait("equations"):
        stage("computing the counter-examples")
        rows = [row.as_dict() for row in equation_table(_keys(papers))]
    if as_json:
        print_json(rows)
        return FINE
    for key in dict.fromkeys(row["paper"] for row in rows):
        found = [row for row in rows if row["paper"] == key]
        cells = [
            (r["number"], r["verdict"], ": ".join(x for x in (r["title"], r["reason"], r["note"]) if x)) for r in found
        ]
        print_table(("number", "verdict", "statement and reading"), cells, title=key)
        print()
    return FINE


def schema(*, sweep: bool = False) -> int:
    """Print the JSON schema of scenario files, for editors.

    Parameters
    ----------
    sweep
        Print the schema of sweep files instead.
    """
    from flocking.papers.sweep_scenarios import sweep_scenarios
    from flocking.study.scenario_files.scenario_file import scenario_schema
    from flocking.study.sweeps.editor_schema import sweep_schema

    print_json(sweep_schema(sweep_scenarios()) if sweep else scenario_schema())
    return FINE


def _keys(papers: Sequence[str]) -> Sequence[str]:
    from flocking.papers import keys

    return tuple(dict.fromkeys(papers)) or keys()
