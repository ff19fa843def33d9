"""Faces that slide on faces: redundant contacts without friction, or with the same one."""

import json
import os
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from llvmlite.binding import get_host_cpu_features
from scipy.integrate import solve_ivp

from msahl.algebra.functions import Law
from msahl.algebra.rotation import from_axis_angle, matrix
from msahl.contact.sharing import least
from msahl.model import ConcentratedLoad
from tests.contact.models import box, run_events
from tests.contact.test_box_pairs import INERTIA, pair, yawed
from tests.support.models import GROUND

G, REACH, ARM = 9.81, 0.2, 0.11
"""Gravity [m/s^2], where the lower box ends [m], and the height of the mass centre [m]."""


def test_least_forces_are_the_nearest_of_all_to_none():
    """The solution x of a projection onto a convex set: x.(v - x) >= 0 for all v in it."""
    rng = np.random.default_rng(3)
    redundant = 0
    for _ in range(300):
        n = int(rng.integers(2, 9))
        G = rng.normal(size=(n, int(rng.integers(1, n + 1))))
        W, y = G @ G.T, np.abs(rng.normal(size=n)) * (rng.random(n) < 0.7)
        x = least(W, y)
        assert (x >= 0.0).all()
        # The null space is found to the root of round-off: W has the squares of G's values.
        assert W @ x == pytest.approx(W @ y, abs=1e-11 * np.abs(W).max())
        assert x @ (y - x) >= -1e-11
        # And it is stationary in the face of the set on which it lies.
        on = np.flatnonzero(x > 0.0)
        null = np.linalg.svd(W[:, on])[2][np.linalg.matrix_rank(W[:, on], tol=1e-9) :]
        assert np.abs(null @ x[on]).max(initial=0.0) < 1e-8
        redundant += G.shape[1] < n
    assert redundant > 100


def test_corners_share_a_load_as_evenly_as_they_can():
    rows = np.array([[1.0, x, y] for x in (-1.0, 1.0) for y in (-1.0, 1.0)])
    W = rows @ rows.T
    assert least(W, np.array([0.0, 2.0, 2.0, 0.0])) == pytest.approx(np.ones(4), abs=1e-14)
    # Over a point of the diagonal that two corners alone could hold.
    assert least(W, np.array([1.0, 0.0, 0.0, 3.0])) == pytest.approx(
        [0.0, 1.0, 1.0, 2.0], abs=1e-14
    )


def over_an_edge(t, friction, begin=0.05):
    """Position, pitch and speeds of a box that slides at 1 m/s from x = ``begin`` over an edge at x
    = 0.2 m, and tips where its forces can be at the edge alone.
    """
    # Friction at the lower face moves the point in which the face presses forward.
    way = REACH - ARM * friction - begin
    v = np.sqrt(1.0 - 2.0 * friction * G * way)
    tips = 2.0 * way / (1.0 + v)

    def rates(_, y):
        x, z, theta, vx, vz, spin = y
        s, c = np.sin(theta), np.cos(theta)
        # The gap (s, c).(place - edge) - 0.12 and its gradient by (x, z, theta).
        along = c * (x - REACH) - s * (z - 0.1)
        gap = np.array([s, c, along])
        # What a force N presses with, and -mu N along the face, which slips forwards.
        press = gap + friction * np.array([-c, s, ARM])
        bend = 2.0 * spin * (c * vx - s * vz) - spin**2 * 0.12
        inverse, free = np.array([1.0, 1.0, 1.0 / INERTIA[1]]), np.array([0.0, -G, 0.0])
        N = -(gap @ free + bend) / (gap * inverse @ press)
        return np.concatenate([y[3:], free + inverse * press * N])

    start = (begin + way, 0.22, 0.0, v, 0.0, 0.0)
    return solve_ivp(rates, (tips, t), start, "DOP853", rtol=1e-12, atol=1e-13).y[:, -1]


def slid(friction=0.0, y=0.013):
    law = {"friction": friction} if friction else None
    return pair((0.05, y, 0.22), law=law, base=(0.2, 0.2, 0.1), velocity=(1.0, 0.0, 0.0))


AT_THE_EDGE = ["Touch.edge8.edge1", "Touch.edge8.edge3"]
MOST = 20
"""Changes of a contact in such a run: four close at first, two pass to the edge, two open, each of
which may begin to slide as well."""


@pytest.mark.slow
@pytest.mark.parametrize("y", [0.013, 0.0])
@pytest.mark.parametrize("friction", [0.0, 0.1])
def test_a_box_that_is_slid_over_an_edge_tips(friction, y):
    """Through all that opens and closes the order is that of the scheme."""
    x, z, theta, _, _, spin = over_an_edge(0.25, friction)
    exact = x, z, from_axis_angle((0.0, 1.0, 0.0), theta)[1], spin
    errors = []
    for dt in (0.01, 0.005):
        report, sink, events = run_events(slid(friction, y), "gauss3", dt, 0.25)
        assert sorted(report.contacts["closed"]) == AT_THE_EDGE
        assert len(events) <= MOST
        last = sink.table("states")[-1, 1:]
        assert last[[1, 3, 5, 9, 11]] == pytest.approx([y, 0.0, 0.0, 0.0, 0.0], abs=1e-12)
        errors.append(np.abs(last[[0, 2, 4, 10]] - exact).max())
    assert errors[0] < 1e-9  # of order 6
    assert np.log2(errors[0] / errors[1]) > 5.8


@pytest.mark.slow
@pytest.mark.sampled
@pytest.mark.parametrize("friction", [0.0, 0.1])
@pytest.mark.parametrize("tolerance", [1e-6, 1e-9])
def test_it_tips_by_tolerance_as_well(tolerance, friction):
    model = slid(friction)
    model = replace(model, bodies=(replace(model.bodies[0], position=(0.0531, 0.0, 0.22)),))
    report, sink, events = run_events(model, "auto", 0.01, 0.25, tolerance=tolerance)
    assert sorted(report.contacts["closed"]) == AT_THE_EDGE
    # Dense outputs beyond the edge may see others open for a nanosecond.
    assert len(events) <= 2 * MOST
    x, z, _, _, _, spin = over_an_edge(0.25, friction, 0.0531)
    found = sink.table("states")[-1, [1, 3, 11]]
    assert found == pytest.approx([x, z, spin], abs=2.0 * tolerance)  # rad/s: over 0.1 s


SCRIPT = """
import json
from tests.contact.models import run_events
from tests.contact.test_faces import slid
for friction in (0.0, 0.1):
    report, sink, events = run_events(slid(friction), "gauss3", 0.01, 0.25)
    last = sink.table("states")[-1, 1:].tolist()
    print(json.dumps([sorted(report.contacts["closed"]), len(events), last]))
"""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("processor", "needed"),
    [("Haswell", "avx2"), ("SkylakeX", "avx512f"), ("Zen", "avx2"), ("Prescott", "sse3")],
)
def test_the_motion_does_not_depend_on_the_processor(processor, needed):
    """Sums of other order in the matrices have other round-off."""
    if not get_host_cpu_features().get(needed):
        pytest.skip(f"this processor has no {needed}")
    environment = {**os.environ, "OPENBLAS_CORETYPE": processor}
    command = [sys.executable, "-c", SCRIPT]
    found = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    for line, friction in zip(found.stdout.splitlines(), (0.0, 0.1), strict=True):
        closed, count, last = json.loads(line)
        assert closed == AT_THE_EDGE
        assert count <= MOST
        x, z, _, _, _, spin = over_an_edge(0.25, friction)
        assert np.array(last)[[0, 2, 10]] == pytest.approx([x, z, spin], abs=1e-9)


@pytest.mark.sampled
@pytest.mark.parametrize(
    ("angle", "spin"), [(0.0, 0.0), (0.3, 0.0), (np.pi / 4.0, 0.0), (0.3, 1.0)]
)
def test_a_box_slides_across_another_one_at_any_angle(angle, spin):
    """The corners of what the faces have in common open and close; no motion comes of that, which
    begins along axes of the box.
    """
    model = pair(
        *((0.0, 0.0, 0.22), yawed(angle)),
        base=(0.1, 0.1, 0.1),
        velocity=(0.05, 0.02, 0.0),
        angular_velocity=(0.0, 0.0, spin),
    )
    report, sink, events = run_events(model, "gauss3", 0.02, 1.0)
    states = sink.table("states")[:, 1:]
    assert report.time == 1.0
    # What projections onto gaps take, at edges that are rounded and so not straight for a step.
    assert report.contacts["energyLost"] == pytest.approx(0.0, abs=1e-8)
    # Round-off of a thousand multipliers: positions keep the gaps to 1e-13 of the model's size.
    assert np.abs(states[:, 2:5] - [0.22, 0.0, 0.0]).max() < 1e-12
    if spin == 0.0:
        R = np.array(matrix(yawed(angle)))
        assert states[-1, :3] - [0.0, 0.0, 0.22] == pytest.approx(R @ [0.05, 0.02, 0.0], abs=1e-12)
    assert len(events) < 30


def pushed(height, across=0.0):
    """A box on its four corners under a force that grows by 5 N/s, at a ``height`` [m] above the
    mass centre along x, and a part ``across`` of it along y.
    """
    model = box((0.0, 0.0, 0.1))
    push = ConcentratedLoad(
        *("Push", "Box", (0.0, 0.0, height), (5.0, 5.0 * across, 0.0)),
        *(GROUND.name, (0.0, 0.0, 0.0), GROUND.name),
        law=Law("polynomial", (0.0, 1.0)),
    )
    return replace(model, loads=(push,))


@pytest.mark.parametrize("height", [0.02, 0.05, 0.09])
def test_a_box_that_is_pushed_tips_by_the_height(height):
    """The rear corners leave the floor together, where the moment of the force is m g times half
    of the length.
    """
    ends = 0.2 * G / (5.0 * height)
    _, sink, events = run_events(pushed(height), "gauss3", 0.05, min(ends + 0.1, 4.0))
    opened = [(event[0], event[2]) for event in events if event[1] == "opens"]
    assert sorted(name for _, name in opened) == ["Corner0", "Corner1"][: 2 * (ends < 4.0)]
    for time, _ in opened:
        assert time == pytest.approx(ends, abs=1e-9)
    t = sink.table("states")[:, 0]
    until = t < ends
    found = sink.table("states")[until, 1:]
    assert found[:, 0] == pytest.approx(5.0 * t[until] ** 3 / 6.0, abs=1e-10)
    assert np.abs(found[:, 1:6] - [0.0, 0.1, 0.0, 0.0, 0.0]).max() < 1e-12
    forces = sink.table("reactions")[until, 1:]
    difference = 5.0 * height * t[until] / 0.8
    for k, sign in enumerate((-1.0, -1.0, 1.0, 1.0)):
        assert forces[:, k] == pytest.approx(G / 4.0 + sign * difference, abs=1e-9)
