"""Scenarios for processes of agents."""

import flocking as fk

LAW = fk.Law(fk.Hysteresis(4.0, 0.5), [fk.Gradient(fk.Potential("1/r + 1/(R - r)", R=4.0)), fk.Consensus(0.7)])
LED = fk.Law(
    fk.Hysteresis(3.0, 0.4),
    [
        fk.Gradient(fk.Potential("k*(r - 2)**2/2", k=0.2)), fk.Consensus(0.3),
        fk.Track(fk.Velocity([0.5, 0.0]), 0.0, 0.3),
    ],
)  # fmt: skip

AROUND = fk.Law(
    LED.graph,
    [*LED.terms, fk.Avoid([fk.Ball([2.5, 2.0], 0.5), fk.Wall([0.0, -0.5], [0.0, 1.0])], range=1.0,
                          repulsion_gain=5.0, gamma_agents=False)],
)  # fmt: skip
CLOSE = fk.Law(fk.Hysteresis(6.0, 0.4), [fk.Gradient(fk.Potential("k*(r - 0.3)**2/2", k=3.0)), fk.Consensus(0.3)])
SLOW = fk.Law(fk.Hysteresis(3.0, 0.4), [fk.Gradient(fk.Potential("k*(r - 1)**2/2", k=0.8))])

BAD = {"delay": 0.03, "jitter": 0.05, "loss": 0.2, "expires": 0.35, "seed": 4}


def scenario(n=5, t_end=4.0, law=LED, information=None, latency=0.01, agents=None, **world):
    start = fk.start.box(n, side=5.0, speed=4.0, seed=3)
    information = fk.Messages(0.1, **(BAD | world)) if information is None else information
    return fk.Scenario(
        law,
        start,
        t_end,
        frames=81,
        control=fk.Held(0.05, latency=latency),
        information=information,
        name="nodes",
        agents=fk.Agents() if agents is None else agents,
    )


def same(one, other):
    """Whether two runs have the same bits."""
    return all((getattr(one, name) == getattr(other, name)).all() for name in ("t", "q", "p", "links")) and (
        str(one.switches.tolist()) == str(other.switches.tolist())
    )
