"""Everything that is guaranteed of a scenario before it runs."""

from __future__ import annotations

from flocking.errors import InvalidInput
from flocking.model.law import Scenario
from flocking.study.certificates.alignment_certificates import alignment_certificates
from flocking.study.certificates.certificate import Certificates
from flocking.study.certificates.consensus_certificates import consensus_certificates
from flocking.study.certificates.limit_certificates import energy_and_limits, stopping_certificates
from flocking.study.certificates.linear.directed_consensus import directed_certificates
from flocking.study.certificates.linear.equilibrium_certificates import equilibrium_certificates
from flocking.study.certificates.linear.leader_errors import leader_error_certificates
from flocking.study.certificates.linear.switching_graphs import switching_certificates
from flocking.study.certificates.obstacle_certificates import obstacle_certificates
from flocking.study.certificates.safety_certificates import safety_certificates
from flocking.study.certificates.world_certificates import world_certificates


def certify(scenario: Scenario) -> Certificates:
    """What is guaranteed of every run of a scenario, from its law and start alone; nothing is simulated.

    Parameters
    ----------
    scenario
        The scenario.

    Returns
    -------
    Certificates
        Each with its theorem, its hypotheses as found, and an enclosed number; refused ones say why.

    Raises
    ------
    InvalidInput
        When it is no scenario.

    Examples
    --------
    >>> import flocking as fk
    >>> law = fk.Law(fk.Fixed.complete(3), [fk.Gradient(fk.Potential("1/r + r**2")), fk.Consensus(1.0)])
    >>> start = fk.State([[0, 0], [1, 0], [0, 1]], [[0, 0], [0, 0], [0, 0.5]])
    >>> found = fk.certify(fk.Scenario(law, start, t_end=1.0))
    >>> found["closest_approach"].outcome
    'granted'
    """
    if not isinstance(scenario, Scenario):
        raise InvalidInput("certify", "scenario", "must be a Scenario", scenario)
    found = (
        *energy_and_limits(scenario), *consensus_certificates(scenario), *alignment_certificates(scenario),
        *switching_certificates(scenario), *directed_certificates(scenario), *leader_error_certificates(scenario),
        *equilibrium_certificates(scenario), *world_certificates(scenario), *safety_certificates(scenario),
        *obstacle_certificates(scenario),
        *stopping_certificates(scenario),
    )  # fmt: skip
    return Certificates(scenario.name, found)
