"""What claims look at: quantities computed once from a run."""

from __future__ import annotations

from flocking.study.evidence.approach import ApproachEvidence
from flocking.study.evidence.basis import MOST_DENSE, NotMeasurable
from flocking.study.evidence.ledger import LEDGER_FACTOR, SLACK, LedgerEvidence
from flocking.study.evidence.links import LinkEvidence


class Evidence(LedgerEvidence, LinkEvidence, ApproachEvidence):
    """Measured quantities of a run, each computed when first asked for.

    Parameters
    ----------
    run
        The run.
    """


__all__ = ["LEDGER_FACTOR", "MOST_DENSE", "SLACK", "Evidence", "NotMeasurable"]
