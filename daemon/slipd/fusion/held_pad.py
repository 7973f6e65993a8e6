"""What motions of the arm a grip holds: half-spaces in what the object feels, one for each way it could begin to slip.

A pad holds while, for every twist q that could begin on it, the power of its load stays below that of friction:
ℓ·q ≤ μ F D(q) with D(q) = Σ w_i |v + ω × r_i| for the shares w_i of its normal force F (the convex form of
`slipd.fusion.limit_surface`). A change of what the object feels changes ℓ and F linearly. So each twist, and each edge
over which the contact could tip, is a half-space, and what holds is convex: the nearest one limits the acceleration.
A moment that tips the object moves the pressure, and so the place of friction, and gathers it near an edge: both add to
the spin.

A finite set of twists leaves out a little of the friction limit; `NET_SHARE` counts so much less friction.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from slipd.fusion.compiled import compiled, compiled_sum
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
"""The lever of friction against a spin shrinks as the centroid comes near an edge, by the part of the way that it went;
not below this."""
MOST = 1e9
"""Stands for what nothing holds, so that comparisons and sums stay finite."""


class HeldPad(NamedTuple):
    """One pad, its load, and how a change of what the object feels adds to it. Vectors are in the pad frame.

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
        twists: v (2) of the centroid, ω, μ D(q) and the noise of the load's power of each twist, shape (5, k).
        edges: Outward direction (2), room for the contact centroid to move, and distance of the edge from the middle of
            the contact, m, of each edge, shape (4, e).
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
    lever = max(float(shares @ np.hypot(x - cx, y - cy)), 1e-6)
    height = (np.arange(DIRECTIONS) + 0.5) / DIRECTIONS
    around, flat = np.arange(DIRECTIONS) * math.pi * (3.0 - math.sqrt(5.0)), np.sqrt(1.0 - height**2)
    even = np.stack((flat * np.cos(around), flat * np.sin(around), height / lever))
    hinges = np.argsort(-shares, kind="stable")[:HINGES]
    about = np.stack((y[hinges] - cy, cx - x[hinges], np.ones(hinges.size))) / lever
    net = np.empty((4, DIRECTIONS + hinges.size))
    net[:3] = np.concatenate((even, about), axis=1)
    dissipate(x - cx, y - cy, shares, net)
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


def tipping_edges(x: Array, y: Array, cx: float, cy: float, half_pitch_m: float) -> Array:
    """Return the edges over which a contact could tip, as in `HeldPad`.

    Args:
        x: Corners of the outline of the loaded taxels, counter-clockwise, shape (n,), m.
        y: Likewise.
        cx: Contact centroid, m.
        cy: Likewise.
        half_pitch_m: The outline may lie so much further out, because a taxel senses over a cell.
    """
    angles = np.arange(TIPPING_DIRECTIONS) * (2.0 * math.pi / TIPPING_DIRECTIONS)
    sides = np.stack((np.roll(y, -1) - y, x - np.roll(x, -1)), axis=1)
    lengths = np.hypot(sides[:, 0], sides[:, 1])
    along = sides[lengths > 0.0] / lengths[lengths > 0.0, None]
    outward = np.concatenate((along, np.stack((np.cos(angles), np.sin(angles)), axis=1)))
    reach = (outward @ np.stack((x, y))).max(axis=1) + half_pitch_m
    middle = outward @ np.array(((x.min() + x.max()) / 2.0, (y.min() + y.max()) / 2.0))
    return np.vstack((outward.T, reach - outward @ np.array((cx, cy)), reach - middle))


@compiled
def turned(turn: Array, x: float, y: float, z: float) -> tuple[float, float, float]:
    """Return a vector of the gripper frame in the pad frame."""
    return (
        turn[0, 0] * x + turn[0, 1] * y + turn[0, 2] * z,
        turn[1, 0] * x + turn[1, 1] * y + turn[1, 2] * z,
        turn[2, 0] * x + turn[2, 1] * y + turn[2, 2] * z,
    )


@compiled_sum
def pad_use(
    pad: HeldPad, felt: tuple[float, float, float], couple: tuple[float, float, float], safety: float, each: Array
) -> tuple[float, float, float, bool]:
    """Find how much of what a pad holds a motion uses, with the worst of what is not known.

    Args:
        pad: The pad.
        felt: Change of the specific force at the centre of mass from that of the load, in the gripper frame, m/s².
        couple: Moment of inertia of a kg about the centre of mass times −α, in the gripper frame, m²/s².
        safety: Factor on the load; of tipping on its change.
        each: Working memory, of the length of `twists` or longer.

    Returns:
        The utilisation; the normal force that would hold the motion with the safety, N; the normal force then, N; and
        whether tipping asks for it.
    """
    px, py, pz = turned(pad.turn, felt[0], felt[1], felt[2])
    kx, ky, kz = turned(pad.turn, couple[0], couple[1], couple[2])
    lx, ly, lz = pad.lever[0], pad.lever[1], pad.lever[2]
    ex, ey, ez = pad.lever_error[0], pad.lever_error[1], pad.lever_error[2]
    most, mean, wide = pad.mass[1], 0.5 * (pad.mass[0] + pad.mass[1]), 0.5 * (pad.mass[1] - pad.mass[0])
    normal = pad.normal - 0.5 * pz * (most if pz > 0.0 else pad.mass[0])
    scale, spin = pad.spin_scale, lx * py - ly * px + kz
    share, part = 0.5 * (pad.shares[0] + pad.shares[1]), 0.5 * (pad.spin_shares[0] + pad.spin_shares[1])
    sx, sy = share * px, share * py
    fx, fy = pad.load[0] + mean * sx, pad.load[1] + mean * sy
    tx, ty = 0.5 * most * (ly * pz - lz * py + kx), 0.5 * most * (lz * px - lx * pz + ky)
    dx, dy = 0.5 * most * (ey * abs(pz) + ez * abs(py)), 0.5 * most * (ez * abs(px) + ex * abs(pz))
    firm, tipped, over, least = max(normal, 1e-9), 0.0, 0.0, MOST
    for k in range(pad.edges.shape[1]):
        ux, uy, room, reach = pad.edges[0, k], pad.edges[1, k], pad.edges[2, k], pad.edges[3, k]
        push = ux * ty - uy * tx + abs(ux) * dy + abs(uy) * dx
        tipped, least = max(tipped, push / max(room, 1e-9)), min(least, room)
        over = max(over, 1.0 - (room - push / firm) / reach)
    gather = 1.0 / max(1.0 - tipped / firm, LEAST_LEVER)
    fm = scale * gather * (pad.load[2] - (ty * fy + tx * fx) / firm + mean * part * spin)
    apart, widely = most * 0.5 * (pad.shares[1] - pad.shares[0]), 0.5 * (pad.spin_shares[1] - pad.spin_shares[0])
    unsure = most * (widely * abs(spin) + pad.spin_shares[1] * (ex * abs(py) + ey * abs(px)))
    unsure = scale * gather * (unsure + (dy * abs(fy) + dx * abs(fx)) / firm)
    twists, count, sm = pad.twists, pad.twists.shape[1], scale * gather * part * spin
    for k in range(count):
        qx, qy, qw = twists[0, k], twists[1, k], twists[2, k]
        power = abs(qx * fx + qy * fy + qw * fm) + wide * abs(qx * sx + qy * sy + qw * sm)
        power += apart * abs(qx * px + qy * py) + unsure * abs(qw) + twists[4, k]
        each[k] = power / twists[3, k]
    worst = largest(each, count)
    used = max(worst / normal, over) if normal > 0.0 else MOST
    if least <= 0.0:  # it has begun to tip: no grip holds
        return min(used, MOST), 2.0 * MOST, normal, True
    return min(used, MOST), min(safety * max(worst, tipped), MOST), normal, tipped > worst


@compiled
def largest(values: Array, count: int) -> float:
    """Return the largest of the first values, at least 0; four at a time, because one waits for the next."""
    a = b = c = d = 0.0
    last = count - count % 4
    for k in range(0, last, 4):
        a, b, c, d = max(a, values[k]), max(b, values[k + 1]), max(c, values[k + 2]), max(d, values[k + 3])
    for k in range(last, count):
        a = max(a, values[k])
    return max(max(a, b), max(c, d))
