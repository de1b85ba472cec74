"""The process of one agent: ``python -m flocking.engine.nodes.agent_process PLACE RUN AGENT``."""

from __future__ import annotations

import argparse
import os
import signal
import sys
import time
from pathlib import Path
from typing import cast

from flocking.engine.nodes.bus import Bus
from flocking.engine.nodes.exported_node import ExportedNode
from flocking.engine.nodes.nodes import Node, PythonNode
from flocking.engine.nodes.requests import Request, answer, packed, unpacked
from flocking.errors import FlockingError

IDLE = 15.0
"""Seconds without a word of the world after which an agent ends."""

HELLO = 0.25
"""Seconds between two announcements of an agent that has not been answered."""

FINE, FAILED, ALONE = 0, 1, 3
"""Exit codes: the run has ended; the agent cannot begin; the world is silent or gone."""


def main() -> int:
    """Serve one agent until the world ends the run or is silent."""
    parser = argparse.ArgumentParser(prog="python -m flocking.engine.nodes.agent_process", description=__doc__)
    parser.add_argument("place", help="address of the world, such as tcp/127.0.0.1:7447")
    parser.add_argument("run", help="name of the run, given by the process of the world")
    parser.add_argument("agent", type=int, help="number of the agent")
    parser.add_argument("--idle", type=float, default=IDLE, help="seconds without a word after which the process ends")
    parser.add_argument("--library", type=Path, help="exported C as a shared object; Python where it is absent")
    given = parser.parse_args()
    # Ctrl-C is for the world, which ends its agents.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        with Bus(connect=given.place) as bus:
            return _serve(bus, given)
    except FlockingError as error:
        print(f"agent {given.agent}: {error}", file=sys.stderr)
        return FAILED


def _serve(bus: Bus, given: argparse.Namespace) -> int:
    own = f"flocking/{given.run}/from/{given.agent}"
    bus.subscribe(f"flocking/{given.run}/to/{given.agent}")
    bus.subscribe(f"flocking/{given.run}/all")
    parent, node, last, said = os.getppid(), cast("Node | None", None), time.monotonic(), 0.0
    while True:
        now = time.monotonic()
        if now - last > given.idle or os.getppid() != parent:
            return ALONE
        if node is None and now - said > HELLO:
            bus.publish(own, packed({"hello": os.getpid()}))
            said = now
        found = bus.next(HELLO)
        if found is None:
            continue
        data, last = unpacked(found[1]), time.monotonic()
        if "end" in data:
            return FINE
        if "scenario" in data:
            if node is None:
                node = _node(data, given)
            bus.publish(own, packed({"ready": os.getpid()}))
        elif "request" in data and node is not None:
            reply = answer(node, cast(Request, data["request"]))
            bus.publish(own, packed({"id": data.get("id"), "answer": reply}))


def _node(data: dict[str, object], given: argparse.Namespace) -> Node:
    from flocking.model.law import Scenario
    from flocking.model.serial import from_data

    scenario = from_data(data["scenario"])
    assert isinstance(scenario, Scenario)
    node: Node = (
        PythonNode(scenario, given.agent)
        if given.library is None
        else ExportedNode(scenario, given.agent, given.library)
    )
    if data.get("begin"):
        node.begin()
    return node


if __name__ == "__main__":
    sys.exit(main())
