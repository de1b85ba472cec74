"""Bad values of the parts of the world: one error that names owner, parameter, rule and value, in files too."""

import inspect

import numpy as np
import pytest

import flocking as fk
from flocking.errors import InvalidInput
from flocking.study.scenario_files.scenario_file import ScenarioFileError, parse_scenario

GOOD = {
    "Held": {"period": 0.1}, "Messages": {"period": 0.1}, "Bernoulli": {"probability": 0.1},
    "GilbertElliott": {"to_bad": 0.1, "to_good": 0.4}, "DistanceLoss": {"range": 1.0}, "WhiteNoise": {},
    "OrnsteinUhlenbeck": {}, "Periodic": {"lengths": [10.0, None]},
}  # fmt: skip

WRONG = (
    "x", b"1", 1j, object(), [], [[]], [None], ["a"], [[1, 2], [3]], {}, np.ones((3, 2)), np.array(["a"]), float("nan"),
    -1.0, -5, 10**400, -(10**400), lambda: 1, [float("nan")],
)  # fmt: skip
"""What no parameter of these parts may be."""


@pytest.mark.parametrize(
    ("kind", "name"), [(kind, name) for kind in GOOD for name in inspect.signature(getattr(fk, kind)).parameters]
)
def test_a_wrong_value_is_one_error_that_names_it(kind, name):
    for value in WRONG:
        with pytest.raises(InvalidInput) as caught:
            getattr(fk, kind)(**{**GOOD[kind], name: value})
        message = str(caught.value)
        assert message.startswith(f"{kind}: {name} must "), message
        assert "; got " in message
        assert len(message) < 600


@pytest.mark.parametrize(
    ("kind", "given"),
    [
        ("Held", {"period": 0.0}), ("Held", {"period": 1e-10}), ("Held", {"period": 1e9}), ("Held", {"latency": True}),
        ("Messages", {"loss": 1.5}), ("Messages", {"loss": True}), ("Messages", {"noise": -0.1}),
        ("Messages", {"seed": True}), ("Messages", {"seed": 1.0}), ("Messages", {"seed": 2**63}),
        ("Messages", {"self_known": "guessed"}), ("Messages", {"expires": 0.0}), ("Messages", {"predict": 1}),
        ("Bernoulli", {"probability": 1.1}), ("Bernoulli", {"paired": 1}), ("DistanceLoss", {"range": 0.0}),
        ("GilbertElliott", {"to_bad": 0.0, "to_good": 0.0}), ("OrnsteinUhlenbeck", {"time_constant": 0.0}),
        ("Periodic", {"lengths": [0.0, 1.0]}), ("Periodic", {"lengths": [None, None]}),
    ],
)  # fmt: skip
def test_a_value_out_of_range_is_one_error_that_names_it(kind, given):
    name = next(iter(given))
    with pytest.raises(InvalidInput, match=f"^{kind}: {name} must .*; got "):
        getattr(fk, kind)(**{**GOOD[kind], **given})


FILE = """
t_end = 1
graph = {kind = "proximity", radius = 2}
terms = [{kind = "consensus"}]
start = {draw = "box", n = 3, side = 4, seed = 5}
control = {kind = "held", period = 0.1}
information = {kind = "messages", period = 0.1, loss = 0.1, noise = {kind = "white", position = 0.1}}
"""


@pytest.mark.parametrize(
    ("old", "new", "place"),
    [
        ('"held", period = 0.1', '"held", period = -1', "control.period: must be greater than 0"),
        ('"held", period = 0.1', '"held"', "control.period: must be given"),
        ('"held"', '"hold"', "control.kind: is not known; got 'hold'. Did you mean 'held'?"),
        (
            '"held", period = 0.1',
            '"held", period = [0.1, 0.2]',
            "control.period: must have one value for",
        ),
        ('"messages", period = 0.1', '"messages", period = "soon"', "information.period: must be a number"),
        ("loss = 0.1", "loss = 1.5", "information.loss: must be"),
        ("loss = 0.1", 'loss = {kind = "bernoulli", probability = 2}', "information.loss.probability: must be"),
        ("loss = 0.1", 'loss = {kind = "distance", range = 0}', "information.loss.range: must be greater than 0"),
        ("loss = 0.1", "seed = -1", "information.seed: must be from 0"),
        ("loss = 0.1", 'self_known = "x"', "information.self_known: must be"),
        ("position = 0.1", "position = -0.1", "information.noise.position: must be at least 0"),
        ('"white"', '"white", color = 1', "information.noise.color: is not known here"),
        ("t_end = 1\n", 't_end = 1\nspace = {kind = "periodic", lengths = [0, 1]}\n', "space.lengths"),
    ],
)
def test_a_fault_in_a_file_is_told_at_its_place(old, new, place):
    assert old in FILE
    with pytest.raises(ScenarioFileError) as caught:
        parse_scenario(FILE.replace(old, new, 1))
    assert [line for line in str(caught.value).splitlines() if line.strip().startswith(place)], str(caught.value)


def test_a_run_too_long_for_nanoseconds_is_refused():
    long = fk.Scenario(
        fk.Law(fk.Proximity(1.0), fk.Consensus(1.0)), fk.State([[0.0, 0.0]]), t_end=1e12, control=fk.Held(1e8)
    )
    with pytest.raises(InvalidInput, match="Scenario: t_end must be at most 2e"):
        fk.start(long)


@pytest.mark.parametrize("build", [fk.Held, fk.Messages, lambda period: fk.Messages(1e-6, expires=period)])
def test_a_period_that_would_be_rounded_to_another_is_refused(build):
    """119.2 nanoseconds would be 119."""
    with pytest.raises(InvalidInput, match="must be a whole number of 1e-9"):
        build(0.125 * 2.0**-20)
    for period in (1.19e-7, 1.0 / 3.0, 5.0001e-6, 1e-9):
        assert build(period) is not None


@pytest.mark.parametrize("value", [[True, False], [0.1, True], np.array([True, True])])
def test_truth_values_are_no_numbers_of_agents(value):
    for build in (lambda: fk.Held(0.1, latency=value), lambda: fk.Held(value), lambda: fk.Agents(masses=value)):
        with pytest.raises(InvalidInput, match="must be an array of numbers; got 'truth values'"):
            build()


@pytest.mark.parametrize("value", [[True, False], (np.True_, 0.5), np.array([True, 2], dtype=object), [0.1, True]])
def test_truth_values_are_no_coordinates(value):
    for build in (
        lambda: fk.State([value, [0.0, 1.0]]),
        lambda: fk.State([[0.0, 1.0]], [value]),
        lambda: fk.Sink(value),
        lambda: fk.Velocity([1.0, 0.0], start=value),
    ):
        with pytest.raises(InvalidInput, match="must be an array of numbers; got 'truth values'"):
            build()


def test_a_matrix_of_neighbours_gives_weights():
    near = np.array([[False, True], [True, False]])
    assert fk.Consensus(1.0, weights=near).weights.values.tolist() == [[0.0, 1.0], [1.0, 0.0]]


def test_times_that_round_to_zero_are_no_part_of_a_summary():
    """Half a nanosecond is none: what is said of a world is what it does."""
    assert fk.Held(0.1, latency=4e-10, phase=1e-12).summary == fk.Held(0.1).summary == "control held for 0.1"
    assert fk.Messages(0.1, delay=4e-10, phase=1e-12).summary == fk.Messages(0.1).summary
    assert fk.Held(0.1, latency=6e-10).summary == "control held for 0.1, acting 6e-10 later"
    assert fk.Messages(0.1, jitter=6e-10).summary == "messages every 0.1, 0 to 6e-10 late"


def test_obstacles_of_a_safety_filter_need_open_space_of_their_dimensions() -> None:
    """They have no images: agents would pass through them, one length further."""
    law = fk.Law(fk.Proximity(1.0), [fk.Consensus(1.0)])
    start = fk.State([[5.0, 5.0]], [[-2.0, 0.0]])

    def behind(*obstacles: fk.Obstacle) -> fk.Scenario:
        control = fk.SafetyFilter(0.1, distance=0.5, acceleration=2.0, form="stopping", obstacles=obstacles)
        return fk.Scenario(law, start, t_end=1.0, control=control)

    kept = behind(fk.Ball([9.5, 5.0], 0.5))
    with pytest.raises(fk.InvalidInput, match="must be open for obstacles of a SafetyFilter"):
        kept.with_(space=fk.Periodic([10.0, 10.0]))
    assert behind().with_(space=fk.Periodic([10.0, 10.0])).space == fk.Periodic([10.0, 10.0])
    for wrong in (fk.Ball([0.0], 1.0), fk.Wall([0.0, 0.0, 0.0], [1.0, 0.0, 0.0])):
        with pytest.raises(fk.InvalidInput, match="must have 2 dimensions each"):
            behind(wrong)
