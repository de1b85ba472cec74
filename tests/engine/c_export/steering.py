"""Steering terms written a second time, by scalars that carry the sizes of what they add up."""

from __future__ import annotations

import numpy as np

from flocking.model.terms import braking, steering
from tests.engine.c_export.sizes import Sized, root

NONE = Sized(0.0, 0.0)


def of(vector):
    return [Sized.of(x) for x in vector]


def dot(a, b):
    found = NONE
    for x, y in zip(a, b, strict=True):
        found = found + x * y
    return found


def unit(a):
    length = root(dot(a, a))
    return [x / length for x in a] if length.value > 0.0 else a


def stopping_speed(x, a, p):
    """The braking curve of Vasarhelyi et al. 2018."""
    if x.value <= 0.0:
        return NONE
    if p * x.value < a / p:
        return p * x
    return root(2.0 * a * x - Sized.of(a / p) * (a / p))


def beyond(v, allowed):
    """What of a vector is longer than is allowed."""
    excess = root(dot(v, v)) - allowed
    return [excess * x for x in unit(v)] if excess.value > 0.0 else [NONE] * len(v)


def weighed(term, total, count):
    if term.total == "direction":
        return [term.weight * x for x in unit(total)]
    share = max(count, 1) if term.total == "mean" else 1
    return [term.weight * x / share for x in total]


def _sum(vectors, m):
    total = [NONE] * m
    for v in vectors:
        total = [a + b for a, b in zip(total, v, strict=True)]
    return total


def term_force(term, q, p, seen):
    """Force of one term, from offsets and velocities of those around, as `Sized` numbers."""
    m, own = len(q), of(p)
    apart = [(of(d), root(dot(of(d), of(d))), of(v)) for d, v in seen]
    radius = getattr(term, "radius", np.inf)
    near = [(d, r, v) for d, r, v in apart if r.value < radius]
    if isinstance(term, steering.Separation | steering.Alignment | steering.Cohesion):
        speed = float(np.sqrt((p**2).sum()))

        def ahead(d, r):
            cosine = float(np.dot([x.value for x in d], p))
            return r.value < term.near or speed == 0.0 or cosine > term.cosine * r.value * speed

        cone = [x for x in near if term.cosine <= -1.0 or ahead(x[0], x[1])]
        count = len(cone)
        if isinstance(term, steering.Separation):
            vectors = [[-x / r**term.exponent for x in d] for d, r, _ in cone if r.value > 0.0]
            count = count if term.among is None else sum(r.value < term.among for _, r, _ in apart)
        elif isinstance(term, steering.Cohesion):
            vectors = [d for d, _, _ in cone]
        else:
            turned = unit if term.compared == "headings" else list
            mine = turned(own) if term.relative else [NONE] * m
            vectors = [[a - b for a, b in zip(turned(v), mine, strict=True)] for _, _, v in cone]
        return weighed(term, _sum(vectors, m), count)
    if isinstance(term, braking.LinearRepulsion):
        pushes = [(min(term.slope * (term.radius - r), Sized.of(term.most), key=float), d) for d, r, _ in near]
        return _sum([[-push * x for x in unit(d)] for push, d in pushes], m)
    if isinstance(term, braking.BrakingAlignment):
        found = []
        for _, r, v in (x for x in apart if x[1].value < term.range):
            curve = stopping_speed(r - term.radius, term.acceleration, term.slope)
            difference = [a - b for a, b in zip(v, own, strict=True)]
            found.append([term.gain * x for x in beyond(difference, max(Sized.of(term.slack), curve, key=float))])
        return _sum(found, m)
    if isinstance(term, braking.SelfPropulsion):
        return [term.speed * x for x in unit(own)]
    return _of_places(term, of(q), own, m)


def _of_places(term, q, own, m):
    if isinstance(term, steering.TurnBack):
        distance = root(dot(q, q))
        if distance.value < term.radius:
            return [NONE] * m
        share = min(Sized.of(1.0), Sized.of(term.speed) / distance, key=float)
        ahead, wanted = unit(own), [-x * share - v for x, v in zip(q, own, strict=True)]
        along = dot(wanted, ahead)
        return [x - along * a for x, a in zip(wanted, ahead, strict=True)]
    if isinstance(term, braking.ShillWalls):
        found = []
        for axis, x in enumerate(q):
            shill = [-v for v in own]
            shill[axis] = Sized.of(-term.speed * np.sign(x.value)) - own[axis]
            gap = Sized.of(term.half_width) - Sized.of(abs(x.value)) - term.offset
            found.append(beyond(shill, stopping_speed(gap, term.acceleration, term.slope)))
        return _sum(found, m)
    assert isinstance(term, braking.ShillDisc)
    offset = [x - c for x, c in zip(q, term.centre, strict=True)]
    gap = root(dot(offset, offset)) - term.radius
    shill = [term.speed * x - v for x, v in zip(unit(offset), own, strict=True)]
    return beyond(shill, stopping_speed(gap, term.acceleration, term.slope))
