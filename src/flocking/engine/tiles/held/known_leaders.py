"""Leaders by messages in the control kernel: what each agent knows of them are numbers of agents, in sorted order."""

from __future__ import annotations

from dataclasses import replace

from flocking.arrays import Numbers32
from flocking.engine.imperfect.messages.leader_news import LeaderNews, leader_news
from flocking.engine.imperfect.messages.leader_slots import layout_as_known, rows_of_leaders
from flocking.engine.tiles.kernels.spec import KernelSpec
from flocking.engine.tiles.particles.law_parameters import LawParameters
from flocking.model.law import Scenario
from flocking.model.world.times import Instants


class KnownLeaders:
    """Parameters of the control kernel under a law with leaders as agents know them.

    Which samples they have follows from the time alone, and so does what is written here: a checkpoint lacks it.

    Parameters
    ----------
    scenario
        The law, the energy, the points that it moves, and the messages.
    spec
        Specification of the kernel of the steps.
    news
        Samples of leaders.

    Attributes
    ----------
    spec
        The specification with leaders as agents know them.
    parameters
        Those in force.
    newest
        Number of the sample that was written last for each agent, -1 for the start, shape (n,).
    """

    parameters: LawParameters
    newest: Instants

    def __init__(self, scenario: Scenario, spec: KernelSpec, news: LeaderNews) -> None:
        layout = layout_as_known(scenario)
        self.spec = replace(spec, layout=layout, weights=layout.weight_kinds())
        self._news = news
        self._rows = rows_of_leaders(layout, len(scenario.law.leaders), spec.dimension)

    def take_parameters(self, scenario: Scenario, t: float, ids: Numbers32, n: int) -> None:
        """Take the gains that are in force from a time on.

        Parameters
        ----------
        scenario, t, ids, n
            As for `LawParameters`.
        """
        self.parameters = LawParameters(scenario, self.spec, t, ids, n)

    def put(self, now: int, ids: Numbers32) -> None:
        """Write what agents know where the kernel reads it.

        Parameters
        ----------
        now
            The time in nanoseconds from the start.
        ids
            Number of the agent at each place, without pads, shape (n,).
        """
        self.newest = self._news.newest(now, ids.astype(int))
        motions = self._news.motions(now, self.newest)
        for rows, motion in zip(self._rows, motions, strict=True):
            self.parameters.A[rows, : len(ids)] = motion
        self.parameters.fill_pads()


def known_leaders(scenario: Scenario, spec: KernelSpec) -> KnownLeaders | None:
    """Leaders of a scenario as agents know them by messages; None where they are known exactly.

    Parameters
    ----------
    scenario, spec
        As for `KnownLeaders`.
    """
    news = leader_news(scenario)
    return None if news is None else KnownLeaders(scenario, spec, news)
