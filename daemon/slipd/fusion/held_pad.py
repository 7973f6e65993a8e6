"""Which motions of the arm a grip holds: half-spaces of the apparent gravity, one for each way to begin to slip.

A pad holds while, for every twist q that could begin on it, the power of its load stays below that of friction:
ℓ·q ≤ μ F D(q) with D(q) = Σ w_i |v + ω × r_i| for the shares w_i of its normal force F (the convex form of
`slipd.fusion.limit_surface`). A change of the apparent gravity γ (gravity minus acceleration) at the centre of mass
changes ℓ and F linearly. So each twist, and each edge over which the contact could tip, is a half-space in γ, and the
motions that hold are a convex set: the nearest half-space limits the acceleration.

A moment that tips the object moves the pressure, and so the place of friction, and gathers it near an edge: both add to
the spin.

A finite set of twists leaves out a little of the friction limit; `NET_SHARE` counts so much less friction.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from slipd.fusion.compiled import compiled, compiled_part, compiled_sum, compiled_sum_part
from slipd.types.arrays import Array

DIRECTIONS = 128
"""Twists spread evenly over half a sphere: the other half is their reverse."""
HINGES = 48
"""Twists about single taxels, those with the most load: the limit surface has its flat parts there."""
NET_SHARE = 0.97
"""Share of friction that counts: the finite set leaves out up to 2 %, and a tilt changes a bit more than modelled."""
TIPPING_DIRECTIONS = 16
"""Directions in which the contact may tip, beside the edges of its outline."""
LEAST_LEVER = 0.02
"""The lever of friction against a spin shrinks to this least share as the centroid comes near an edge."""
LEAST_ROOM_M = 1e-9
"""Room of an edge that the centroid has reached, so that quotients stay finite."""
UNBOUNDED = 1e9
"""Stands for infinity, for a load that no grip holds, so that comparisons and sums stay finite."""
ROUNDING = 1.0 + 1e-9
"""Factor on a bound, so that rounding does not bring it below what it bounds."""
Triple = tuple[float, float, float]


class HeldPad(NamedTuple):
    """One pad, its load, and how a change of the apparent gravity adds to it. Vectors are in the pad frame.

    Attributes:
        turn: Turns vectors of the gripper frame into the pad frame, shape (3, 3).
        lever: Centre of mass of the object from the point between both pads, shape (3,), m.
        lever_error: How far each component may be off, shape (3,), m.
        load: Tangential force and spin about the contact centroid now, shape (3,), N and N·m.
        normal: Normal force now, N.
        shares: Least and largest share of a change of the tangential force, shape (2,).
        spin_shares: Likewise of the spin.
        mass: Least and largest mass, shape (2,), kg.
        mu: Low bound of static friction.
        spin_scale: How many times as much friction a spin uses.
        twists: v (2) of the centroid, ω and the noise of the load's power of each twist, over μ D(q), shape (4, k).
        edges: As of `tipping_edges`, shape (4, e).
    """

    turn: Array
    lever: Array
    lever_error: Array
    load: Array
    normal: float
    shares: Array
    spin_shares: Array
    mass: Array
    mu: float
    spin_scale: float
    twists: Array
    edges: Array


_HEIGHT = (np.arange(DIRECTIONS) + 0.5) / DIRECTIONS
_AROUND, _FLAT = np.arange(DIRECTIONS) * math.pi * (3.0 - math.sqrt(5.0)), np.sqrt(1.0 - _HEIGHT**2)
_EVEN = np.stack((_FLAT * np.cos(_AROUND), _FLAT * np.sin(_AROUND), _HEIGHT))


def twist_net(x: Array, y: Array, shares: Array, cx: float, cy: float) -> Array:
    """Return twists that could begin, and what friction dissipates in each.

    Args:
        x: Taxel centres, shape (n,), m.
        y: Likewise.
        shares: Load on each at a normal force of 1 N, shape (n,).
        cx: Contact centroid, m.
        cy: Likewise.

    Returns:
        v (2) of the centroid, ω and D(q) of each, shape (4, k), in m/s, rad/s and N·m/s up to a common factor.
    """
    x, y, hinges = x - cx, y - cy, np.argsort(-shares, kind="stable")[:HINGES]
    net = np.ones((4, DIRECTIONS + hinges.size))
    net[:3, :DIRECTIONS] = _EVEN
    net[0, DIRECTIONS:], net[1, DIRECTIONS:] = y[hinges], -x[hinges]
    lever = max(float(shares @ np.hypot(x, y)), 1e-6)
    net[2] /= lever
    net[:2, DIRECTIONS:] /= lever
    dissipate(x, y, shares, net)
    return net


@compiled_sum
def dissipate(x: Array, y: Array, shares: Array, net: Array) -> None:
    """Fill in D(q), the last row of a twist net, for taxels at places relative to the centroid."""
    for k in range(net.shape[1]):
        vx, vy, om = net[0, k], net[1, k], net[2, k]
        total = 0.0
        for i in range(x.size):
            ux, uy = vx - om * y[i], vy + om * x[i]
            total += shares[i] * math.sqrt(ux * ux + uy * uy)
        net[3, k] = total


@compiled
def tipping_edges(x: Array, y: Array, cx: float, cy: float, half_pitch_m: float) -> Array:
    """Return the edges over which a contact could tip.

    Args:
        x: Corners of the outline of the loaded taxels, counter-clockwise, shape (n,), m.
        y: Likewise.
        cx: Contact centroid, m.
        cy: Likewise.
        half_pitch_m: The outline may lie so much further out, because a taxel senses over a cell.

    Returns:
        Of each edge, shape (4, e): the outward direction (2) over the room that the contact centroid has, 1/m; the part
        of the way from the middle of the contact that the centroid has gone, 1 or more where it has begun to tip; and
        the part that is left.
    """
    count, edges = x.size, np.empty((4, x.size + TIPPING_DIRECTIONS))
    middle_x, middle_y = 0.5 * (x.min() + x.max()), 0.5 * (y.min() + y.max())
    for k in range(edges.shape[1]):
        angle = (k - count) * (2.0 * math.pi / TIPPING_DIRECTIONS)
        ux, uy = math.cos(angle), math.sin(angle)
        if k < count:
            after = (k + 1) % count
            length = math.hypot(x[k] - x[after], y[k] - y[after])
            if length > 0.0:  # else an outline of one taxel
                ux, uy = (y[after] - y[k]) / length, (x[k] - x[after]) / length
        far = -math.inf
        for i in range(count):
            far = max(far, ux * x[i] + uy * y[i])
        far += half_pitch_m
        room, reach = far - ux * cx - uy * cy, far - ux * middle_x - uy * middle_y
        least = max(room, LEAST_ROOM_M)
        edges[0, k], edges[1, k], edges[2, k], edges[3, k] = ux / least, uy / least, 1.0 - room / reach, least / reach
    return edges


@compiled_part
def turned(turn: Array, x: float, y: float, z: float) -> tuple[float, float, float]:
    """Return a vector of the gripper frame in the pad frame."""
    return (
        turn[0, 0] * x + turn[0, 1] * y + turn[0, 2] * z,
        turn[1, 0] * x + turn[1, 1] * y + turn[1, 2] * z,
        turn[2, 0] * x + turn[2, 1] * y + turn[2, 2] * z,
    )


class MovedLoad(NamedTuple):
    """The load of a pad in a motion. Vectors are in the pad frame.

    Attributes:
        normal: Normal force, N.
        tipped: Normal force without which the contact would tip, N.
        over: Part of the way to an edge that the contact centroid goes.
        begun: The contact has begun to tip already now.
        load: Tangential force (2) and spin about the contact centroid, N and N·m, by the mean of mass and shares.
        more: What a kg more adds to it.
        pull: Tangential part of the change of the apparent gravity, shape (2,), m/s².
        wide_kg: How far the mass may be off.
        apart_kg: How far the share of the tangential force may be off, times the mass.
        unsure_nm: How far the spin may be off for other reasons.
    """

    normal: float
    tipped: float
    over: float
    begun: bool
    load: Triple
    more: Triple
    pull: tuple[float, float]
    wide_kg: float
    apart_kg: float
    unsure_nm: float


@compiled_part
def moved_load(pad: HeldPad, change: Triple, couple: Triple) -> MovedLoad:
    """Return the load of a pad in a motion.

    Args:
        pad: The pad.
        change: Change of the apparent gravity at the centre of mass from that of the load, in the gripper frame, m/s².
        couple: Torque of inertia of 1 kg about the centre of mass, −k² α with the radius of gyration k, in the gripper
            frame, m²/s².
    """
    px, py, pz = turned(pad.turn, change[0], change[1], change[2])
    kx, ky, kz = turned(pad.turn, couple[0], couple[1], couple[2])
    lx, ly, lz = pad.lever[0], pad.lever[1], pad.lever[2]
    ex, ey, ez = pad.lever_error[0], pad.lever_error[1], pad.lever_error[2]
    most, mean, wide = pad.mass[1], 0.5 * (pad.mass[0] + pad.mass[1]), 0.5 * (pad.mass[1] - pad.mass[0])
    normal = pad.normal - 0.5 * pz * (most if pz > 0.0 else pad.mass[0])
    spin, edges = lx * py - ly * px + kz, pad.edges
    share, part = 0.5 * (pad.shares[0] + pad.shares[1]), 0.5 * (pad.spin_shares[0] + pad.spin_shares[1])
    sx, sy = share * px, share * py
    fx, fy = pad.load[0] + mean * sx, pad.load[1] + mean * sy
    tx, ty = 0.5 * most * (ly * pz - lz * py + kx), 0.5 * most * (lz * px - lx * pz + ky)
    dx, dy = 0.5 * most * (ey * abs(pz) + ez * abs(py)), 0.5 * most * (ez * abs(px) + ex * abs(pz))
    firm, tipped, over, gone = max(normal, 1e-9), 0.0, 0.0, 0.0
    eased = 1.0 / firm
    for k in range(edges.shape[1]):
        ux, uy, way = edges[0, k], edges[1, k], edges[2, k]
        push = ux * ty - uy * tx + abs(ux) * dy + abs(uy) * dx
        tipped, over, gone = max(tipped, push), max(over, way + edges[3, k] * push * eased), max(gone, way)
    turns = pad.spin_scale / max(1.0 - tipped / firm, LEAST_LEVER)
    fm = turns * (pad.load[2] - (ty * fy + tx * fx) / firm + mean * part * spin)
    apart, widely = most * 0.5 * (pad.shares[1] - pad.shares[0]), 0.5 * (pad.spin_shares[1] - pad.spin_shares[0])
    unsure = most * (widely * abs(spin) + pad.spin_shares[1] * (ex * abs(py) + ey * abs(px)))
    unsure = turns * (unsure + (dy * abs(fy) + dx * abs(fx)) / firm)
    more = (sx, sy, turns * part * spin)
    return MovedLoad(normal, tipped, over, gone >= 1.0, (fx, fy, fm), more, (px, py), wide, apart, unsure)


@compiled_sum_part
def moved_utilisation(pad: HeldPad, moved: MovedLoad, safety: float, work: Array) -> tuple[float, float, bool]:
    """Find the utilisation of a pad by a load, with the worst of what is not known.

    Args:
        pad: The pad.
        moved: The load.
        safety: Factor on the load; of tipping on its change.
        work: Working memory, of the length of `twists` or longer.

    Returns:
        The utilisation; the normal force that would hold the load with the safety, N; and whether tipping asks for it.
    """
    twists, count, (fx, fy, fm), (sx, sy, sm), (px, py) = (
        pad.twists, pad.twists.shape[1], moved.load, moved.more, moved.pull
    )  # fmt: skip
    for k in range(count):
        qx, qy, qw = twists[0, k], twists[1, k], twists[2, k]
        power = abs(qx * fx + qy * fy + qw * fm) + moved.wide_kg * abs(qx * sx + qy * sy + qw * sm)
        work[k] = power + moved.apart_kg * abs(qx * px + qy * py) + moved.unsure_nm * abs(qw) + twists[3, k]
    worst = largest(work, count)
    used = max(worst / moved.normal, moved.over) if moved.normal > 0.0 else UNBOUNDED
    needed = 2.0 * UNBOUNDED if moved.begun else min(safety * max(worst, moved.tipped), UNBOUNDED)
    return min(used, UNBOUNDED), needed, moved.begun or moved.tipped > worst


@compiled
def pad_utilisation(
    pad: HeldPad, change: Triple, couple: Triple, safety: float, work: Array
) -> tuple[float, float, float, bool]:
    """Return what `moved_utilisation` does for a motion as in `moved_load`, and as third value the normal force, N."""
    moved = moved_load(pad, change, couple)
    used, needed, tips = moved_utilisation(pad, moved, safety, work)
    return used, needed, moved.normal, tips


@compiled_part
def twist_bounds(pad: HeldPad) -> Triple:
    """Return the half axes, slide and spin, of an ellipsoid that contains the twists of a pad, and the most noise."""
    twists, slide, spin, noise, wide = pad.twists, 0.0, 0.0, 0.0, 0.0
    for k in range(twists.shape[1]):
        slide, spin = max(slide, math.hypot(twists[0, k], twists[1, k])), max(spin, abs(twists[2, k]))
        noise = max(noise, twists[3, k])
    for k in range(twists.shape[1]):
        wide = max(wide, math.hypot(math.hypot(twists[0, k], twists[1, k]) / slide, twists[2, k] / spin))
    return slide * wide, spin * wide, noise


@compiled_part
def needed_bound(moved: MovedLoad, twists: Triple) -> float:
    """Return a bound of the normal force that friction needs under a load, from the result of `twist_bounds`, N.

    The power of a twist against a load is at most the product of both lengths, in units in which every twist of the
    pad is at most 1 long.
    """
    slide, spin, noise = twists
    (fx, fy, fm), (sx, sy, sm), (px, py) = moved.load, moved.more, moved.pull
    slide2, spin2 = slide * slide, spin * spin
    most = math.sqrt(slide2 * (fx * fx + fy * fy) + spin2 * fm * fm)
    most += moved.wide_kg * math.sqrt(slide2 * (sx * sx + sy * sy) + spin2 * sm * sm)
    return ROUNDING * (most + moved.apart_kg * slide * math.sqrt(px * px + py * py) + moved.unsure_nm * spin + noise)


@compiled_part
def largest(values: Array, count: int) -> float:
    """Return the largest of the first values, at least 0; four at a time, because one waits for the next."""
    a = b = c = d = 0.0
    last = count - count % 4
    for k in range(0, last, 4):
        a, b, c, d = max(a, values[k]), max(b, values[k + 1]), max(c, values[k + 2]), max(d, values[k + 3])
    for k in range(last, count):
        a = max(a, values[k])
    return max(max(a, b), max(c, d))
