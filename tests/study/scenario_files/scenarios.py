"""Scenarios that together use every word of scenario files."""

import numpy as np

import flocking as fk
from flocking.model.graphs.smooth_graphs import PerAgentRadii, Smooth
from flocking.model.leaders_and_obstacles.obstacles import Ball, Wall
from flocking.model.leaders_and_obstacles.polygons import ConvexPolygon
from flocking.model.terms.avoidance import Avoid

PSI = fk.Potential("1/r + 1/(R - r)", R=4.0)
LEADER = fk.Path(["cos(w*t)", "sin(t)"], start=[0.1, 1 / 3], start_time=0.5, w=0.7)
GRAPH = fk.Hysteresis(4.0, 0.1)
START = fk.start.box(5, side=3.0, speed=1.0, seed=3, connected_under=GRAPH)
OTHER = fk.Proximity(2.5, closed=True)


ALIGN = (fk.Consensus(1.0),)


def scenario(graph=GRAPH, terms=ALIGN, **rest):
    return fk.Scenario(fk.Law(graph, terms), **{"start": START, "t_end": 0.3, "frames": 4, **rest})


SCENARIOS = {
    "hysteresis": scenario(terms=(fk.Gradient(PSI), fk.Consensus(0.1 + 0.2))),
    "fixed": scenario(fk.Fixed(5, ((0, 1), (3, 2), (4, 0)), directed=True)),
    "no edges": scenario(fk.Fixed(5, ())),
    "complete": scenario(fk.Complete(), (fk.CuckerSmale(2.0, 0.7, 1 / 3),)),
    "another complete": scenario(terms=(fk.CuckerSmale(2.0, 0.7, over=fk.Complete()),)),
    "proximity": scenario(OTHER, (fk.Gradient(fk.Potential("log(r)^2"), weighting="force"),)),
    "smooth": scenario(Smooth(5.0, 0.8, bump="quintic"), (fk.Consensus(1.0, weighted=True),)),
    "sigma-norm": scenario(
        Smooth(5.0, 0.8, sigma_norm=0.1),
        (
            fk.Consensus(1.0, weighted=True),
            Avoid(fk.Ball([9.0, 0.0], 1.0), range=2.0, gamma_agents=False, sigma_norm=1 / 3, fading_damping=True),
        ),
    ),
    "radii": scenario(PerAgentRadii(np.array([1.0, 2.0, 3.0, 4.0, 1 / 7]))),
    "own bump": scenario(Smooth(5.0, 0.8, bump=fk.Bump("line", "where(z < k0, 1, (1 - z)/(1 - k0))"))),
    "periodic": scenario(space=fk.Periodic([99.0, None])),
    "messages": scenario(
        control=fk.Held([0.1, 0.2, 0.1, 0.2, 0.1], latency=0.01),
        information=fk.Messages(
            0.05,
            delay=0.02,
            loss=fk.GilbertElliott(0.1, 0.4),
            noise=fk.OrnsteinUhlenbeck(0.1, 0.1),
            expires=0.5,
            seed=3,
        ),
    ),
    "lost messages": scenario(
        control=fk.Held(0.1), information=fk.Messages(0.05, loss=0.2, noise=fk.WhiteNoise(0.1), predict=True)
    ),
    "far messages": scenario(control=fk.Held(0.1), information=fk.Messages(0.05, loss=fk.DistanceLoss(3.0))),
    "late": scenario(information=fk.Delayed(0.1, self_delayed=True)),
    "late by pairs": scenario(information=fk.Delayed(np.arange(25.0).reshape(5, 5) / 7 * (1 - np.eye(5)))),
    "cone": scenario(fk.Cone(3.0, np.arange(1.0, 6.0), "wrapped"), agents=fk.Agents(headings=np.arange(5) * 0.1)),
    "smooth cone": scenario(fk.SmoothCone(3.0, 0.5, 1 / 3), agents=fk.Agents(headings=np.arange(5) * 0.1)),
    "view": scenario(fk.FieldOfView(3.0, 1.0), agents=fk.Agents(headings=np.arange(5) * 0.1)),
    "schedule": scenario(
        terms=(
            fk.Track(
                fk.Sink([0.0, 1.0]),
                fk.Schedule([0.1, 0.2], [1.0, 0.0, 1 / 3]),
                fk.Schedule([0.1], [np.ones(5), np.arange(5) / 7]),
            ),
        )
    ),
    "matrix": scenario(terms=(fk.Consensus(np.arange(5) / 3, weights=np.arange(25.0).reshape(5, 5) / 7),)),
    "hashed": scenario(terms=(fk.Consensus(2.0, weights=fk.HashedWeights(0.1, 0.9, 2**62)),)),
    "two graphs": scenario(terms=(fk.Gradient(PSI), fk.Consensus(1.0, over=OTHER), fk.Consensus(0.5, over=OTHER))),
    "functional": scenario(terms=(fk.Consensus(1.0, functional=True, over=fk.Fixed(5, ((0, 1),))),)),
    "own graph again": scenario(terms=(fk.Consensus(1.0, over=GRAPH),)),
    "sink": scenario(terms=(fk.Track(fk.Sink([1.0, -0.0]), 1 / 3, saturated=True, shared=True),)),
    "velocity": scenario(terms=(fk.Track(fk.Velocity([1.0, 2.0], [0.5, 0.25], 0.125), velocity_gain=np.ones(5) / 3),)),
    "shared leader": scenario(
        terms=(fk.Track(LEADER, 0.3, 0.7, 1.0, per_mass=True), fk.Track(LEADER)), energy=fk.Energy("leader", LEADER)
    ),
    "equal leaders, not shared": scenario(terms=(fk.Track(fk.Sink([1.0, 2.0])), fk.Track(fk.Sink([1.0, 2.0])))),
    "agents": scenario(
        terms=(fk.Consensus(1.0), fk.Compensate()),
        agents=fk.Agents(masses=np.linspace(0.05, 1, 5), damping=np.arange(5) / 9),
    ),
    "headings": scenario(agents=fk.Agents(headings=np.arange(5) * 0.1)),
    "rotations": scenario(agents=fk.Agents(headings=np.stack([np.eye(2)] * 5))),
    "first order": scenario(agents=fk.Agents(order=1)),
    "point masses": scenario(agents=fk.PointMass(np.linspace(0.5, 1, 5), 0.1)),
    "chain of bodies": scenario(
        agents=fk.Limited(
            fk.Lagged(fk.Disturbed(fk.PointMass(), 0.1, 0.05, seed=3), np.linspace(0.1, 0.2, 5)), force=2.0, rate=1 / 3
        )
    ),
    "headings set at ticks": scenario(
        terms=(fk.VelocityAverage(np.arange(5) / 3),),
        control=fk.Held(0.1),
        start=fk.State(START.q, np.full(START.q.shape, 0.5**0.5)),
        agents=fk.Heading(1.0, noise=np.arange(5) / 7, seed=3),
    ),
    "safety filter": scenario(control=fk.SafetyFilter(0.1, distance=0.2, acceleration=np.arange(1, 6) / 3, gain=0.3)),
    "impulses": scenario(agents=fk.Impulsive(speed=np.arange(1, 6) / 3, update="forward"), control=fk.Held(0.1)),
    "steering": scenario(
        terms=(
            fk.Separation(12.0, 5.0, -0.707, 1.5, "mean", 1 / 3, 7.0),
            fk.Alignment(8.0, 7.5, 0.7, relative=False),
            fk.Cohesion(8.0, 9.0, -0.15),
            fk.TurnBack(50.0, 1 / 3),
        ),
        agents=fk.Impulsive(update="shuffled", seed=3),
        control=fk.Held(0.1),
    ),
    "wanted velocities": scenario(
        terms=(
            fk.SelfPropulsion(1 / 3),
            fk.LinearRepulsion(0.4, 25.6668, 6.19664),
            fk.BrakingAlignment(0.023802, 0.5, 1 / 3, 2.5, 0.4, 100.0),
            fk.ShillWalls(230.0, 1 / 3, 2.5, 0.4),
            fk.ShillDisc([0.1, 1 / 3], 2.0, 6.5, 2.5, 0.4),
        ),
        agents=fk.VelocityUnit(np.arange(1, 6) / 3, speed=2.0, fixed=True, seed=5),
        control=fk.Held(0.1),
        information=fk.Fixes(0.1, delay=0.3, range=100.0, diffusion=1 / 3, damping=0.1, stiffness=0.01, seed=2),
    ),
    "unicycles": scenario(agents=fk.Unicycle(0.1)),
    "mixtures": scenario(
        agents=fk.Mixture((fk.PointMass(damping=np.arange(5) / 7), fk.Lagged(fk.Unicycle(0.1), 0.3)), [0, 1, 1, 0, 1])
    ),
    "quadrotors": scenario(
        agents=fk.Quadrotor(masses=np.arange(1, 6) / 3, reach=0.7),
        start=fk.State(np.hstack([START.q, np.arange(5)[:, None] / 7])),
    ),
    "single integrators": scenario(agents=fk.SingleIntegrator(headings=np.arange(5) * 0.1)),
    "energy": scenario(energy=fk.Energy("centre of mass", unlinked=0.1, name='J "tilde" \\')),
    "frames": scenario(frames=(0.0, 0.1, 0.30000000000000004 - 1e-16), tolerance=1e-7, seed=2**40, name="naïve é"),
    "links": scenario(start=fk.State(START.q, START.p, 0.1, np.eye(5, k=1, dtype=bool) | np.eye(5, k=-1, dtype=bool))),
    "no links": scenario(start=fk.State(START.q, links=np.zeros((5, 5), bool))),
    "obstacles": scenario(
        terms=(
            Avoid(
                (
                    Ball([5.0, 1.0], 2.0),
                    Ball(LEADER, 1.0),
                    Wall([0.0, -9.0], [0.0, 2.0]),
                    ConvexPolygon([[9.0, 9.0], [10.0, 9.0], [9.0, 10.0]], 0.5, fk.Velocity([0.1, 0.2])),
                ),
                LEADER,
                range=4.2,
            ),
        )
    ),
    "space": fk.Scenario(
        fk.Law(OTHER, fk.Consensus(1.0)), fk.start.box(4, side=[1.0, 2.0, 3.0], seed=1, speed=1.0), t_end=0.2, frames=3
    ),
}


DRAWN = """
t_end = 1
terms = [{kind = "consensus"}]
[graph]
kind = "hysteresis"
radius = 4
gap = 0.1
[start]
draw = "box"
n = 6
side = 4
speed = 2
seed = 5
connected = true
"""
