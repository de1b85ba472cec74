"""Quantities computed once from a run, from which claims are judged."""

from __future__ import annotations

from flocking.study.evidence.basis import MOST_DENSE, NotMeasurable, NotResolvable
from flocking.study.evidence.farthest_links import FarthestLinkEvidence
from flocking.study.evidence.ledger import LEDGER_FACTOR, SLACK, LedgerEvidence
from flocking.study.evidence.obstacle_approach import ObstacleEvidence
from flocking.study.evidence.records import RecordEvidence


class Evidence(LedgerEvidence, FarthestLinkEvidence, ObstacleEvidence, RecordEvidence):
    """Measured quantities of a run, each computed when first needed.

    Parameters
    ----------
    run
        The run.
    """


__all__ = ["LEDGER_FACTOR", "MOST_DENSE", "SLACK", "Evidence", "NotMeasurable", "NotResolvable"]
