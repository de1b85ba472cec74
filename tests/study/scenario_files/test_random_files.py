"""Random text and randomly changed scenario files are read or refused."""

import json
import tomllib

import pytest
import tomli_w
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import flocking as fk
from flocking.study.scenario_files.scenario_file import (
    ScenarioFileError,
    parse_scenario,
)
from tests.study.scenario_files.random_files import BASES, VALUES, places


@settings(max_examples=40, deadline=None, suppress_health_check=list(HealthCheck))
@given(data=st.data())
def test_mutated_files_are_read_or_refused_in_plain_words(data):

    table = json.loads(json.dumps(data.draw(st.sampled_from(BASES))))
    for _ in range(data.draw(st.integers(1, 3))):
        *path, last = data.draw(st.sampled_from([p for p in places(table) if p]))
        owner = table
        for key in path:
            owner = owner[key]
        action = data.draw(st.sampled_from(["replace", "remove", "add"]))
        if action == "remove":
            del owner[last]
        elif action == "add" and isinstance(owner, dict):
            owner[data.draw(st.text(min_size=1, max_size=8))] = data.draw(VALUES)
        else:
            owner[last] = data.draw(VALUES)
    text = tomli_w.dumps(table)
    assert tomllib.loads(text) is not None
    message = refusal(text)
    assert message is None or ("\n  " in message and "Traceback" not in message)


def refusal(text):
    """The message of a file that is refused; anything but a refusal goes through."""
    try:
        assert isinstance(parse_scenario(text), fk.Scenario)
    except ScenarioFileError as error:
        return str(error)
    return None


@settings(max_examples=100, deadline=None)
@given(text=st.text(max_size=200) | st.binary(max_size=200).map(lambda b: b.decode("latin-1")))
def test_any_text_is_read_or_refused(text):
    with pytest.raises(ScenarioFileError):
        parse_scenario(text)
