"""Requests of a page, each by its kind."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from flocking.apps.lab.live.frame_bytes import RequestedParts
from flocking.apps.lab.live.hub import Tab
from flocking.apps.lab.live.lab import SLOWEST, Lab
from flocking.apps.lab.panels.agent_forces import agent_content
from flocking.apps.lab.panels.catalogue import small_picture
from flocking.apps.lab.panels.choices import is_built_in, scenario_of
from flocking.apps.lab.panels.controls import properties, tried
from flocking.apps.lab.panels.ready_terms import TERMS
from flocking.apps.lab.scene.filming import Look
from flocking.errors import FlockingError, InvalidInput
from flocking.model.checks import integer, number
from flocking.model.serial import to_data

Order = dict[str, Any]
Answer = dict[str, object] | None
"""The answer to the page that sent it; None for none."""

SLOW = frozenset(
    {
        "load", "space", "branch", "try", "properties", "small picture", "save", "save picture", "save score", "film",
        "save film", "open run", "compare", "agent", "catalogue",
    }
)  # fmt: skip
"""Kinds of orders that compute for long, or wait for the clock."""

EVENTS = frozenset(
    {"kick", "place", "shift", "kill", "add", "cut", "term", "drop", "obstacle", "remove", "clear obstacles"}
)
"""Kinds of events that a page sends as they are; values of parts and moved objects are orders of their own."""


OF_THE_LIVE_RUN = frozenset(
    {"play", "step", "event", "set", "move", "add term", "restart", "go back", "branch", "only one"}
)
"""Kinds of orders that would change the live run unseen while a stored one is shown."""

OF_WHAT_IS_SEEN = frozenset({"kick", "place", "shift", "kill", "add", "cut", "obstacle", "remove", "move"})
"""Kinds of changes at places, or of agents and obstacles, that are chosen in the scene: in a recorded moment there are
others, which have other numbers."""


class Orders:
    """Carries out the orders of pages.

    Parameters
    ----------
    page
        The lab that is steered.
    """

    def __init__(self, page: Lab) -> None:
        self._page = page

    @staticmethod
    def is_slow(kind: object) -> bool:
        """Whether an order of this ``kind`` computes for long."""
        return kind in SLOW

    def obey(self, tab: Tab, order: Order) -> None:
        """Carry out an order of a page; what is not possible is reported to it, with the ``id`` of the order.

        Parameters
        ----------
        tab
            The page.
        order
            The order.
        """
        kind, about = order["kind"], {"id": order.get("id")}
        act = _ORDERS.get(kind)
        try:
            if act is None:
                raise InvalidInput("lab", "kind", f"must be one of {', '.join(_ORDERS)}", kind)
            if kind in OF_THE_LIVE_RUN and self._page.past.stored is not None:
                hint = "Go back to the live run first, under files."
                raise InvalidInput("lab", str(kind), "is for the live run alone", "a stored run is shown", hint)
            if tab.looking is not None and _changed(order) in OF_WHAT_IS_SEEN:
                hint = "Go to the present first, or branch from there."
                raise InvalidInput("lab", _changed(order), "is done to the present", "a recorded moment is shown", hint)
            answer = act(self._page, tab, order)
        except (FlockingError, OSError) as error:
            self._page.refuse(tab, str(error), {**about, "about": kind, "path": order.get("path")})
        except KeyError as missing:
            self._page.refuse(tab, f"An order of kind {kind!r} needs {missing}.", {**about, "about": kind})
        except Exception as error:  # one order must not end the page
            self._page.refuse(tab, f"{type(error).__name__}: {error}", {**about, "about": kind})
        else:
            if answer is not None or order.get("id") is not None:
                tab.tell({"kind": "answer", **about, **(answer or {})})


def _changed(order: Order) -> str:
    """Kind of the change that an order requests: that of its event, where it has one."""
    event = order.get("event")
    return str(event.get("kind") if order["kind"] == "event" and isinstance(event, dict) else order["kind"])


def _play(page: Lab, _: Tab, __: Order) -> None:
    page.clock.play()
    page.tell_record()


def _pause(page: Lab, _: Tab, __: Order) -> None:
    page.clock.pause()
    page.tell_record()


def _step(page: Lab, _: Tab, order: Order) -> None:
    page.clock.step(number("lab", "duration", order["duration"], above=0.0))


def _speed(page: Lab, _: Tab, order: Order) -> None:
    page.run_at(number("lab", "speed", order["speed"], least=SLOWEST))


def _load(page: Lab, _: Tab, order: Order) -> None:
    seed = order.get("seed")
    page.load(str(order["name"]), None if seed is None else integer("lab", "seed", seed, least=0))


def _reset(page: Lab, _: Tab, __: Order) -> None:
    page.load(page.name, page.seed)


def _event(page: Lab, _: Tab, order: Order) -> None:
    event = order["event"]
    if not isinstance(event, dict) or event.get("kind") not in EVENTS:
        raise InvalidInput("lab", "event", f"must be one of {', '.join(sorted(EVENTS))}", event)
    page.apply(event)


def _set(page: Lab, _: Tab, order: Order) -> None:
    page.controls.move(order["path"], order["value"], factor=bool(order.get("factor")))


def _move(page: Lab, _: Tab, order: Order) -> None:
    event = {"kind": "move", "path": order["path"]}
    if "by" in order:  # steps add up, so that none may replace another
        page.apply(event | {"by": order["by"]})
    else:
        page.send(event | {"to": order["to"]}, ("move", *order["path"]))


def _add_term(page: Lab, _: Tab, order: Order) -> None:
    name = order["name"]
    if name not in TERMS:
        raise InvalidInput("lab", "term", f"must be one of {', '.join(TERMS)}", name)
    frame = page.clock.frame
    page.apply({"kind": "term", "term": to_data(TERMS[name](frame.scenarios[0].law, frame.states[0]))})


def _look(page: Lab, tab: Tab, order: Order) -> None:
    t = order.get("t")
    page.past.look(tab, None if t is None else number("lab", "t", t))


def _branch(page: Lab, _: Tab, order: Order) -> None:
    page.branch(number("lab", "t", order["t"]))


def _try(page: Lab, _: Tab, order: Order) -> Answer:
    frame = page.clock.frame
    return tried(frame.scenarios[0], frame.states[0], order["path"], str(order["text"]))


def _properties(page: Lab, _: Tab, order: Order) -> Answer:
    return {"rows": properties(page.clock.frame.scenarios[0], order["path"])}


def _small_picture(page: Lab, _: Tab, order: Order) -> Answer:
    name = str(order["name"])
    if not is_built_in(name):
        file = page.folder.inside(name)
        return {"name": name, "picture": small_picture(scenario_of(name, file))} if file.suffix == ".toml" else None
    return {"name": name, "picture": small_picture(scenario_of(name, page.folder.path / name))}


def _agent(page: Lab, _: Tab, order: Order) -> Answer:
    frame = page.clock.frame
    agent, run = integer("lab", "agent", order["agent"], least=0), integer("lab", "run", order.get("run", 0), least=0)
    if run >= len(frame.states):
        raise InvalidInput("lab", "run", f"must be one of 0..{len(frame.states) - 1}", run)
    return agent_content(frame.scenarios[run], frame.states[run], agent)


def _compare(page: Lab, _: Tab, order: Order) -> None:
    page.compare(order["path"], number("lab", "value", order["value"]))


def _save(page: Lab, _: Tab, __: Order) -> Answer:
    page.count_request()
    return page.saved(page.files.save_scenario())


def _save_picture(page: Lab, _: Tab, order: Order) -> Answer:
    page.count_request()
    return page.saved(page.files.save_picture(order["data"]))


def _save_score(page: Lab, _: Tab, __: Order) -> Answer:
    page.count_request()
    score = page.measuring.score()
    if score is None:
        raise InvalidInput("lab", "score", "needs a challenge", "none")
    return page.saved(page.files.save_score(page.measuring.challenge, score))


def _film(page: Lab, _: Tab, __: Order) -> None:
    page.files.start_film()


def _save_film(page: Lab, _: Tab, order: Order) -> Answer:
    page.count_request()
    look = Look(str(order.get("color")), bool(order.get("links")), bool(order.get("dark")))
    return page.saved(page.files.save_film(look))


def _open_run(page: Lab, _: Tab, order: Order) -> None:
    page.count_request()
    page.past.open_run(str(order["name"]))


def _close_run(page: Lab, _: Tab, __: Order) -> None:
    page.close_run()


def _wants(page: Lab, tab: Tab, order: Order) -> None:
    parts = (bool(order.get(name)) for name in ("energies", "virtual_agents", "flocks"))
    tab.requested = RequestedParts(*parts)
    page.past.look(tab, tab.looking)


def _catalogue(page: Lab, tab: Tab, _: Order) -> None:
    page.tell_catalogue(tab)


_ORDERS: dict[str, Callable[[Lab, Tab, Order], Answer]] = {
    "play": _play, "pause": _pause, "step": _step, "speed": _speed, "load": _load, "reset": _reset,
    "restart": lambda page, *_: page.restart(), "space": lambda page, *_: page.lift(),
    "go back": lambda page, *_: page.go_back(), "event": _event, "set": _set, "move": _move, "add term": _add_term,
    "look": _look, "branch": _branch, "try": _try, "properties": _properties, "small picture": _small_picture,
    "agent": _agent, "compare": _compare, "only one": lambda page, *_: page.only_one(), "save": _save,
    "save picture": _save_picture, "film": _film, "save film": _save_film, "save score": _save_score,
    "open run": _open_run, "close run": _close_run, "wants": _wants, "catalogue": _catalogue,
}  # fmt: skip
