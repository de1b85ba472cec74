"""Recordings of runs of agents: what was written is read, and other files are refused in a sentence."""

import json
import pickle

import numpy as np
import pytest

import flocking as fk
from flocking.errors import InvalidInput, StorageError
from flocking.study.sample_files.reading import read_samples
from tests.engine.nodes.worlds import scenario
from tests.unpickling import Harm, watched

pytestmark = pytest.mark.nodes


def recorded(folder):
    place = folder / "run.mcap"
    return place, fk.simulate_nodes(scenario(3, 0.5), processes=False, record=place, progress=False)


def written(path, messages, encoding="json"):
    from mcap.writer import Writer

    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        schema = writer.register_schema("state", "jsonschema", b"{}")
        channel = writer.register_channel("/state", encoding, schema)
        for k, data in enumerate(messages):
            writer.add_message(channel, k, data if isinstance(data, bytes) else json.dumps(data).encode(), k)
        writer.finish()
    return path


def test_frames_and_samples_keep_their_bits(tmp_path):
    from mcap.reader import make_reader

    place, run = recorded(tmp_path)
    samples = read_samples(place)
    assert all((a == b).all() for a, b in ((samples.t, run.t), (samples.q, run.q), (samples.p, run.p)))
    with place.open("rb") as file:
        sent = [json.loads(m.data) for _, _, m in make_reader(file).iter_messages(topics=["/sample"])]
    # Samples at 0, 0.1, ..., 0.4 s of three agents.
    assert [(x["sender"], x["number"]) for x in sent] == [(i, k) for k in range(5) for i in range(3)]
    assert [x["q"] for x in sent[:3]] == run.q[0].tolist()


def test_names_are_taken_once_and_end_in_mcap(tmp_path):
    place, _ = recorded(tmp_path)
    for path, said in (
        (place, "there already"),
        (tmp_path / "run.bag", "ends in .mcap"),
        (tmp_path / "no/x.mcap", "cannot write"),
    ):
        with pytest.raises(StorageError, match=said):
            fk.simulate_nodes(scenario(3, 0.5), processes=False, record=path, progress=False)


@pytest.mark.parametrize(
    ("messages", "said"),
    [
        ([], "must have messages of the topic /state"), ([b"\xff"], "finished MCAP file"), ([[1]], "is no object"),
        ([{"t": 0.0}], "q"), ([{"t": 0.0, "q": [[1.0]]}, {"t": 1.0, "q": [[1.0], [2.0]]}], "one shape"),
        ([{"t": 0.0, "q": [["x"]]}], "must be numbers"), ([{"t": 0.0, "q": [1.0]}], "q"),
        ([{"t": 1.0, "q": [[1.0]]}, {"t": 0.0, "q": [[1.0]]}], "t"),
        ([{"t": 0.0, "q": [[1.0]], "p": [[1.0, 2.0]]}], "shape of q"),
    ],
)  # fmt: skip
def test_other_files_are_refused(messages, said, tmp_path):
    with pytest.raises(InvalidInput, match=said):
        read_samples(written(tmp_path / "x.mcap", messages))


def test_cut_and_foreign_files_are_refused(tmp_path):
    place, _ = recorded(tmp_path)
    data = place.read_bytes()
    for k, part in enumerate((data[: len(data) // 2], data[:9], b"", np.random.default_rng(0).bytes(999))):
        path = tmp_path / f"{k}.mcap"
        path.write_bytes(part)
        with pytest.raises(InvalidInput, match="must be a finished MCAP file"):
            read_samples(path)
    with pytest.raises(InvalidInput, match="are protobuf, not JSON"):
        read_samples(written(tmp_path / "y.mcap", [b"x"], "protobuf"))


def test_nothing_in_a_recording_is_unpickled(tmp_path):
    harm = tmp_path / "harm"
    payload = pickle.dumps(Harm(harm))
    place = written(tmp_path / "whole.mcap", [{"t": 0.5 * k, "q": [[float(k)]]} for k in range(6)])
    whole = place.read_bytes()
    (tmp_path / "pickle.mcap").write_bytes(payload)
    (tmp_path / "before.mcap").write_bytes(payload + whole)
    (tmp_path / "amid.mcap").write_bytes(whole[:40] + payload + whole[40:])
    written(tmp_path / "message.mcap", [payload])
    written(tmp_path / "encoding.mcap", [payload], "pickle")
    with watched():
        assert read_samples(place).q.tolist() == [[[float(k)]] for k in range(6)]
        for name in ("pickle", "before", "amid", "message", "encoding"):
            with pytest.raises(InvalidInput):
                read_samples(tmp_path / f"{name}.mcap")
    assert not harm.exists()


def logged(place):
    """Times at which messages were logged, by topic, and the last frame."""
    from mcap.reader import make_reader

    found = {"/state": [], "/sample": []}
    last = {}
    with place.open("rb") as file:
        for _, channel, message in make_reader(file).iter_messages():
            found[channel.topic].append(message.log_time)
            last[channel.topic] = json.loads(message.data)
    return found, last


def test_frames_and_samples_are_logged_on_one_clock_whenever_the_run_begins(tmp_path):
    first = scenario(3, 0.5)
    for begin in (-7.5, 0.0, 100.0):
        place = tmp_path / f"{begin}.mcap"
        begun = first.with_(start=fk.State(first.start.q, first.start.p, begin), t_end=begin + 0.5)
        run = fk.simulate_nodes(begun, processes=False, record=place, progress=False)
        found, _ = logged(place)
        assert found["/state"] == [round(1e9 * (t - begin)) for t in run.t]
        assert sorted(set(found["/sample"])) == [0, 100_000_000, 200_000_000, 300_000_000, 400_000_000]
        assert np.array_equal(read_samples(place).t, run.t)


def test_frames_of_agents_of_order_1_hold_no_velocities(tmp_path):
    law = fk.Law(fk.Proximity(9.0), [fk.Gradient(fk.Potential("r**2/2"))])
    slow = scenario(3, 0.5, law=law, agents=fk.Agents(order=1))
    fk.simulate_nodes(slow, processes=False, record=tmp_path / "slow.mcap", progress=False)
    assert set(logged(tmp_path / "slow.mcap")[1]["/state"]) == {"t", "q"}
    assert read_samples(tmp_path / "slow.mcap").p is None
