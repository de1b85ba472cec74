"""Every script of the gallery runs, draws its picture, and shows what it says it shows."""

from __future__ import annotations

import runpy
from pathlib import Path

import numpy as np
import pytest

import flocking as fk
from flocking.model.observables import flocks

GALLERY = Path(__file__).resolve().parents[2] / "gallery"
SCRIPTS = {path.stem.removeprefix("plot_"): path for path in sorted(GALLERY.glob("plot_*.py"))}


def tanner_2003_fixed(made):
    report = fk.audit(made["run"])
    assert report.as_expected
    assert report["energy-falls"].verdict == "holds"


def tanner_2003_dynamic(made):
    assert made["ends"][made["whole"]] == 1
    assert made["ends"][made["split"]] > 1


def zhou_2015(made):
    assert fk.audit(made["run"]).as_expected
    assert not (made["run"].switches["kind"] == "break").any()


def shi_2009(made):
    assert made["measured"] == pytest.approx(1 / np.sqrt(2), abs=2e-3)
    late = made["informed"].p[-1] - [np.sin(30), np.cos(30)]
    assert np.abs(late).max() < 1e-2


def olfati_saber_2003(made):
    run = made["run"]
    for ball in made["system"].obstacles():
        away = np.linalg.norm(run.q - ball.centre.at(0.0)[0], axis=-1)
        assert away.min() > ball.radius
    assert run.q[-1, :, 0].mean() > 200


def own_potential(made):
    run = made["run"]
    assert made["fk"].audit(run)["velocities-agree"].verdict == "holds"
    lines = (GALLERY / "plot_own_potential.py").read_text().split("# %%")[0].split('"""')[2]
    assert len([line for line in lines.splitlines() if line.strip()]) <= 15


def live_lab(made):
    assert made["count"] > 1
    assert made["same"]
    assert len(made["experiment"].log.entries) == 1
    shown = (GALLERY / "plot_live_lab.py").read_text().split(".. image:: ../")[1].split()[0]
    assert (GALLERY.parent / "docs" / shown).stat().st_size > 10_000


def space(made):
    run = made["run"]
    assert run.q.shape[2] == 3
    assert np.abs(run.p[-1] - run.p[-1].mean(axis=0)).max() < 0.2


def field_of_view(made):
    around, ahead = (np.linalg.norm(np.ptp(made[k].p.mean(axis=1), axis=0)) for k in ("around", "ahead"))
    assert around < 1e-12
    assert ahead > 0.05


def moving_obstacles(made):
    run = made["run"]
    for ball in (made["swing"], made["drift"]):
        away = [np.linalg.norm(q - ball.centre.at(t)[0], axis=1).min() for t, q in zip(run.t, run.q, strict=True)]
        assert min(away) > ball.radius


def figure_of_eight(made):
    run = made["run"]
    centre = run.q.mean(axis=1)
    leader = np.array([made["leader"].at(t)[0] for t in run.t])
    assert np.linalg.norm(centre - leader, axis=1)[len(run.t) // 2 :].max() < 2.5
    assert (made["informed"] > 0).sum() == 3


def cucker_smale_2007(made):
    certificates, run = made["certificates"], made["run"]
    assert all(certificates[key].granted for key in ("alignment_diameter", "alignment_rate"))
    diameter = max(np.linalg.norm(q[:, None] - q[None], axis=2).max() for q in run.q)
    assert diameter < certificates["alignment_diameter"].bound.hi
    assert made["distance"] == pytest.approx(np.tan(1.2), abs=0.03)
    assert made["speed"] == pytest.approx(1.7 - np.pi / 2, abs=5e-4)
    monotone, reaction, unstable = (np.abs(r.p[:, 0, 0] - r.p[:, 1, 0]) for r in made["late"])
    assert (np.diff(monotone) <= 1e-12).all()
    assert reaction[-100:].max() < 0.1 < 1 < unstable[-100:].max()


def own_terms(made):
    start, law = made["begin"], made["law"]
    offset = start.q[None] - start.q[:, None]
    r = np.sqrt((offset**2).sum(axis=-1)) + np.eye(start.n)
    off = ~np.eye(start.n, dtype=bool)
    push = np.where((r < 1.0) & off, 3.0 * (1 - 1 / r**2), 0.0)
    pull = np.where((r < 3.5) & off, 0.12, 0.0)
    brute = np.einsum("ij,ijk->ik", (push + pull) / r, offset)
    brute += np.einsum("ij,ijk->ik", np.where((r < 2.0) & off, 0.3, 0.0), start.p[None] - start.p[:, None])
    brute += 0.5 * (1 - (start.p**2).sum(axis=1, keepdims=True)) * start.p
    np.testing.assert_allclose(fk.control(law, start), brute, rtol=1e-10, atol=1e-11)
    assert made["order"](made["run"].state(-1)) > 0.9


def vicsek_1995(made):
    assert set(made["verdicts"].values()) == {"holds"}
    gathering, ordered = (np.linalg.norm(run.p[-1].mean(axis=0)) / 0.03 for run in made["runs"][1:])
    assert ordered > 0.99 > gathering > 0.5
    curves = [line for axes in made["transition"].axes for line in axes.lines if line.get_gid() == "curve"]
    # The larger the group, the lower the order at strong noise.
    strong = [float(line.get_ydata()[-2]) for line in curves[:3]]
    assert strong == sorted(strong, reverse=True)
    assert 0.7 < (40 * made["order"] ** 2).mean() < 1.3


def reynolds_1987(made):
    assert set(made["verdicts"].values()) == {"holds"}
    assert made["late"][0] != made["late"][1]
    drawn = [a for a in made["picture"].axes if any(c.get_gid() == "velocity" for c in a.collections)]
    assert len(drawn) == 5
    assert made["apart"] > 0.3


def vasarhelyi_2018(made):
    assert made["means"]["speed"] > 2.0
    assert made["means"]["overrun"] < 10.0
    np.testing.assert_allclose(made["distances"], [2.5, 10.0, (64 + 6.25**2) / 5])
    np.testing.assert_allclose(made["article"].braking_speed(made["distances"], 2.5, 0.4), made["speeds"])
    assert len([a for a in made["picture"].axes if any(x.get_gid() == "walls" for x in a.lines)]) == 5
    plain, program, optimized, _ = made["late"].values()
    assert max(plain, program) < 0.4
    assert optimized > 0.8


def olfati_saber_2006(made):
    ends = {title: flocks(run.links_at(-1)) for title, run in made["runs"].items()}
    assert ends["Algorithm 1"] > 10
    assert ends["Algorithm 2"] == 1
    assert 1 <= ends["Algorithm 3"] < flocks(made["runs"]["Algorithm 3"].links_at(0))
    assert made["energy"] < made["needed"] == pytest.approx(52.383812, abs=1e-6)
    assert made["pressed"].closest.distance < 1e-6


def obstacle_field(made):
    facts = made["facts"]
    assert max(facts["inside"]) == 0
    # As the page and the README say.
    assert round(100 * facts["largest"][-1]) == 96
    assert facts["audit"]["ledger"][0] == "holds"
    densities = [a for a in made["picture"].axes if a.images]
    assert [a.get_title() for a in densities] == [f"$t = {t:g}$" for t in facts["views"]]
    assert all(len(a.patches) == 60 for a in densities)
    (dots,) = [c for a in made["picture"].axes for c in a.collections if c.get_gid() == "agents"]
    assert len(dots.get_offsets()) > 1000


def flock_from_noise(made):
    assert made["facts"]["order"][-1] > 0.99
    shades = [a.images[0].get_array() for a in made["picture"].axes if a.images]
    dark = [float((np.asarray(x).max(axis=-1) < 0.35).mean()) for x in shades]
    assert len(dark) == 5
    assert dark[0] > 3 * dark[3]


def cluster_obstacles(made):
    assert max(made["kept"]["LAMMPS"].facts["inside"]) == 0
    above, below = np.array([np.asarray(a.images[0].get_array()) for a in made["picture"].axes if a.images]).reshape(
        (2, 3, 165, 240)
    )
    assert np.abs(np.log(above / below)).max() < 0.1
    assert np.ptp(np.log(above)) > 1


SHOWS = {check.__name__: check for check in (
    tanner_2003_fixed, tanner_2003_dynamic, zhou_2015, shi_2009, olfati_saber_2003, own_potential, space, field_of_view,
    live_lab, moving_obstacles, figure_of_eight, cucker_smale_2007, own_terms, reynolds_1987, vasarhelyi_2018,
    vicsek_1995, olfati_saber_2006, obstacle_field, flock_from_noise, cluster_obstacles,
)}  # fmt: skip


def study(made):
    """A study that comes with the library: its stored results are there, and most of its runs went through."""
    table = made["table"]
    assert len(table) >= 20
    assert len(table.failures) < 0.1 * len(table)


SHOWS |= dict.fromkeys((name for name in SCRIPTS if name.startswith("study_")), study)

SLOW = {
    "own_terms", "reynolds_1987", "vasarhelyi_2018",
    "vicsek_1995", "space", "moving_obstacles", "olfati_saber_2003", "olfati_saber_2006",
    "live_lab",
}  # fmt: skip
"""Their kernels are their own and take long to compile the first time; the others are in the default tests."""

ON_BLACK = {"obstacle_field", "flock_from_noise", "cluster_obstacles"}
"""Pictures whose panels are dark where nobody is."""


def test_every_script_is_held_to_what_it_shows():
    assert set(SCRIPTS) == set(SHOWS)


@pytest.mark.parametrize("name", [pytest.param(n, marks=pytest.mark.slow) if n in SLOW else n for n in sorted(SCRIPTS)])
def test_script_runs_and_draws(name, tmp_path, monkeypatch, capsys):
    from matplotlib.figure import Figure
    from matplotlib.image import imread

    monkeypatch.chdir(tmp_path)
    made = runpy.run_path(str(SCRIPTS[name]), run_name="__main__")
    # Pages show what is saved: a figure that is drawn and not saved would be spoken of and not seen.
    drawn = {id(value) for value in made.values() if isinstance(value, Figure)}
    written = sorted(path.name for path in tmp_path.iterdir())
    assert f"plot_{name}.png" in written
    assert len(written) == len(drawn)
    for file in written:
        assert file.startswith(f"plot_{name}")
        picture = imread(tmp_path / file)[..., :3]
        assert min(picture.shape[:2]) > 200
        ground = (picture < 0.1).all(axis=-1) if name in ON_BLACK else (picture >= 0.9).all(axis=-1)
        assert 0.005 < 1.0 - ground.mean() < (0.97 if name in ON_BLACK else 0.6)
    assert capsys.readouterr().out.strip()
    assert made["picture"].axes
    SHOWS[name](made)
