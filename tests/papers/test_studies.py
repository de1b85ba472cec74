"""The shipped studies: their stored results are those of their sweeps, and their pictures show them."""

import numpy as np
import pytest

from flocking.papers.studies.shipped import STUDIES, study
from flocking.study.sweeps.store import read_record
from flocking.study.sweeps.sweep import auditing
from flocking.study.sweeps.worker_tasks import Work, run_task

QUICK = {"tanner-connectivity": 6, "zhou-bound": 4, "shi-informed": 1}
"""How many runs are made anew; a run of Olfati-Saber's takes too long for the default tests."""


def made_anew(name, count):
    file, stored = study(name).plan(), study(name).stored()
    known = {m: file.more_measures.get(m) for m in file.measures}
    from flocking.study.sweeps.measures import MEASURES

    measures = {m: (found or MEASURES[m])[1] for m, found in known.items()}
    work = Work(file.make, measures, auditing(file.audit), {"engine": file.engine})
    for index in np.random.default_rng(1).choice(file.plan.size, count, replace=False):
        row = run_task(work, file.plan.task(int(index)))
        assert row["status"] == stored.rows[int(index)]["status"] == "ok", row["message"]
        for measure, value in row["values"].items():
            kept = stored.rows[int(index)]["values"][measure]
            # Other versions of the libraries may round otherwise, and the motions part slowly.
            assert value == pytest.approx(kept, rel=1e-3, abs=1e-6, nan_ok=True), (index, measure)


@pytest.mark.parametrize("name", QUICK)
def test_runs_made_anew_are_the_stored_ones(name):
    made_anew(name, QUICK[name])


@pytest.mark.slow
@pytest.mark.parametrize("name", STUDIES)
def test_more_runs_made_anew_are_the_stored_ones(name):
    made_anew(name, 1 if name == "olfati-saber-density" else 20)


@pytest.mark.parametrize("name", STUDIES)
def test_stored_results_are_complete_and_of_the_shipped_sweep(name):
    stored, file = study(name).stored(), study(name).plan()
    assert stored.complete
    assert stored.failures == []
    assert stored.plan.as_data() == file.plan.as_data()
    assert stored.measures == file.measures
    from importlib.resources import files

    record = read_record(files("flocking.papers.studies") / "results" / name)
    assert record["make"] == file.record


@pytest.mark.parametrize("name", STUDIES)
def test_the_picture_of_a_study_is_drawn_from_its_results(name):
    picture = study(name).draw(study(name).stored())
    assert len(picture.axes) >= 1
    drawn = [line for axes in picture.axes for line in axes.get_lines()]
    assert drawn
    assert all(axes.get_xlabel() and axes.get_ylabel() for axes in picture.axes if axes.get_label() != "<colorbar>")


def test_a_picture_says_where_means_have_no_interval():
    def notes(name):
        picture = study(name).draw(study(name).stored())
        return [text.get_text() for axes in picture.axes for text in axes.texts if text.get_gid() == "no interval"]

    assert [" ".join(note.split()) for note in notes("olfati-saber-density")] == [
        "no 95 % interval: 0 values, 8 needed; 1 value, 8 needed; 3 values, 8 needed; 8 of 27 runs without a value"
    ]
    assert notes("tanner-connectivity") == []


def test_what_the_studies_found():
    tanner = study("tanner-connectivity").stored().summary()
    dense_slow, wide_fast = tanner.sel(start_radius=1.5, speed=0.5), tanner.sel(start_radius=3.5, speed=4.0)
    assert wide_fast.connected_high < dense_slow.connected_low
    assert study("tanner-connectivity").stored().values("ledger_closes").all()
    zhou = study("zhou-bound").stored()
    assert (zhou.values("closest_linked") > zhou.values("certified_by_links")).all()
    assert (zhou.values("certified_by_links") > zhou.values("certified_closest")).all()
    assert (zhou.values("energy_most") < zhou.values("energy_bound")).all()
    assert zhou.values("connected").all()
    shi = study("shi-informed").stored().summary()
    assert shi.following_time_high.sel(informed=10) < shi.following_time_low.sel(informed=4)
    assert shi.following_high.sel(informed=1) < shi.following_low.sel(informed=4)
    saber = study("olfati-saber-density").stored().summary().density
    assert abs(saber.sel(length=160.0, tracking_gain=10.0) - 0.97) < 0.02
    assert (saber.max("length") == saber.sel(length=160.0)).sel(tracking_gain=[3.0, 10.0]).all()
