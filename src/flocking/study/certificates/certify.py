"""Everything that is guaranteed of a scenario before it runs."""

from __future__ import annotations

from collections.abc import Callable

from flocking.engine.driver.waits import counted
from flocking.errors import FormulaError, InvalidInput
from flocking.model.law import Scenario
from flocking.study.certificates.alignment_certificates import KEYS as ALIGNMENT_KEYS
from flocking.study.certificates.alignment_certificates import alignment_certificates
from flocking.study.certificates.certificate import Certificate, Certificates, Hypothesis, decided
from flocking.study.certificates.consensus_certificates import KEYS as CONSENSUS_KEYS
from flocking.study.certificates.consensus_certificates import consensus_certificates
from flocking.study.certificates.energy_certificates import KEYS as ENERGY_KEYS
from flocking.study.certificates.limit_certificates import KEY as LIMIT_KEY
from flocking.study.certificates.limit_certificates import STOPPING, energy_and_limits, stopping_certificates
from flocking.study.certificates.linear.directed_consensus import KEYS as DIRECTED_KEYS
from flocking.study.certificates.linear.directed_consensus import directed_certificates
from flocking.study.certificates.linear.equilibrium_certificates import KEYS as EQUILIBRIUM_KEYS
from flocking.study.certificates.linear.equilibrium_certificates import equilibrium_certificates
from flocking.study.certificates.linear.leader_errors import DRIFT, leader_error_certificates
from flocking.study.certificates.linear.leader_errors import KEYS as LEADER_KEYS
from flocking.study.certificates.linear.switching_graphs import SWITCHING, switching_certificates
from flocking.study.certificates.obstacle_certificates import KEY as OBSTACLE_KEY
from flocking.study.certificates.obstacle_certificates import obstacle_certificates
from flocking.study.certificates.safety_certificates import OBSTACLES as SAFE_FROM_OBSTACLES
from flocking.study.certificates.safety_certificates import safety_certificates
from flocking.study.certificates.sources import sources
from flocking.study.certificates.world_certificates import DELAY as WORLD_DELAY
from flocking.study.certificates.world_certificates import KEYS as WORLD_KEYS
from flocking.study.certificates.world_certificates import world_certificates

CertificateGroup = tuple[Callable[[Scenario], tuple[Certificate, ...]], str, tuple[str, ...]]

CERTIFICATE_GROUPS: tuple[CertificateGroup, ...] = (
    (energy_and_limits, "energy", (*ENERGY_KEYS, LIMIT_KEY)),
    (consensus_certificates, "spectrum", CONSENSUS_KEYS), (alignment_certificates, "alignment", ALIGNMENT_KEYS),
    (switching_certificates, "switching", SWITCHING), (directed_certificates, "directed", DIRECTED_KEYS),
    (leader_error_certificates, "centre", (DRIFT, *LEADER_KEYS)),
    (equilibrium_certificates, "equilibrium", EQUILIBRIUM_KEYS),
    (world_certificates, "moments", (*WORLD_KEYS, WORLD_DELAY)),
    (safety_certificates, "safety_filter", ("safe_distance", SAFE_FROM_OBSTACLES)),
    (obstacle_certificates, "obstacles", (OBSTACLE_KEY,)), (stopping_certificates, "stopping", STOPPING),
)  # fmt: skip
"""The kinds of certificates: the function that gives them, the key of their source, and their own keys."""


def certify(scenario: Scenario) -> Certificates:
    """What is guaranteed of every run of a scenario, from its law and start alone; nothing is simulated.

    Parameters
    ----------
    scenario
        The scenario.

    Returns
    -------
    Certificates
        Each with its theorem, its hypotheses as found, and an enclosed number; refused ones state why.

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
    found = tuple(
        each for group in counted(CERTIFICATE_GROUPS, "kinds of guarantees", _key) for each in _answers(group, scenario)
    )
    return Certificates(scenario.name, found)


def _answers(group: CertificateGroup, scenario: Scenario) -> tuple[Certificate, ...]:
    """The certificates of one kind; refused where the law has a formula that is not written with exact numbers."""
    of, source, keys = group
    try:
        return of(scenario)
    except FormulaError as error:
        exact = Hypothesis("formulas of the law have exact, finite numbers below 1e100", False, str(error))
        return tuple(decided(key, sources()[source], (exact,)) for key in keys)


def _key(group: CertificateGroup) -> str:
    """Key of the source of a kind of certificates."""
    return group[1]
