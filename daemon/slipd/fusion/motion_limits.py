"""The worst that the arm could do to a gripped object: the nearest half-space of `slipd.fusion.held_pad`."""

from __future__ import annotations

import math

from slipd.fusion.compiled import compiled
from slipd.fusion.held_pad import UNBOUNDED, HeldPad, turned
from slipd.types.arrays import Array


@compiled
def nearest_limit(pad: HeldPad, rest: Array, safety: float, wanted: float, direction: Array) -> tuple[float, float]:
    """Find the acceleration that a pad holds in its worst direction: the distance to the nearest half-space.

    Args:
        pad: The pad.
        rest: Change of apparent gravity and couple without the acceleration, as in `force_ratio`.
        safety: As in `pad_utilisation`.
        wanted: Acceleration that should hold in every direction, m/s².
        direction: Filled with the worst direction, in the gripper frame, shape (3,).

    Returns:
        The acceleration, m/s², 0 where not even rest holds; and the normal force that the pad lacks for ``wanted``, N,
        negative where it has more.
    """
    px, py, pz = turned(pad.turn, rest[0], rest[1], rest[2])
    kx, ky, kz = turned(pad.turn, rest[3], rest[4], rest[5])
    lx, ly, lz = pad.lever[0], pad.lever[1], pad.lever[2]
    ex, ey, ez = pad.lever_error[0], pad.lever_error[1], pad.lever_error[2]
    mass, fx, fy, m = pad.mass[1], pad.load[0], pad.load[1], pad.load[2] * pad.spin_scale
    best, lack, wx, wy, wz = UNBOUNDED, -pad.normal, 1.0, 0.0, 0.0
    for k in range(pad.twists.shape[1]):
        noise = pad.twists[3, k]
        for corner in range(8):
            sign = 1.0 if corner % 2 == 0 else -1.0
            share, part = pad.shares[(corner // 2) % 2], pad.spin_shares[corner // 4]
            qx, qy, qw = sign * pad.twists[0, k], sign * pad.twists[1, k], sign * pad.twists[2, k]
            turns = part * qw * pad.spin_scale
            hx, hy, hz = safety * (share * qx - turns * ly), safety * (share * qy + turns * lx), 0.5
            hx += math.copysign(safety * abs(turns) * ey, hx)
            hy += math.copysign(safety * abs(turns) * ex, hy)
            shift = 0.5 * safety * qw * pad.spin_scale / max(pad.normal, 1e-9)  # of the pressure, under the load of now
            hx, hy, hz = hx - shift * fy * lz, hy + shift * fx * lz, hz + shift * (fy * lx - fx * ly)
            size = mass * math.sqrt(hx * hx + hy * hy + hz * hz)
            spare = pad.normal - safety * (qx * fx + qy * fy + qw * m + noise + mass * turns * kz)
            spare -= mass * (hx * px + hy * py + hz * pz)
            lack = max(lack, size * wanted - spare)
            if spare < best * size:
                best, wx, wy, wz = spare / size, hx, hy, hz
    half = 0.5 * safety
    for k in range(pad.edges.shape[1]):
        ux, uy, room = pad.edges[0, k], pad.edges[1, k], (1.0 - pad.edges[2, k]) / pad.edges[3, k]
        hx, hy, hz = half * ux * lz, half * uy * lz, 0.5 * room - half * (ux * lx + uy * ly)
        hx += math.copysign(half * abs(ux) * ez, hx)
        hy += math.copysign(half * abs(uy) * ez, hy)
        hz += math.copysign(half * (abs(ux) * ex + abs(uy) * ey), hz)
        size = mass * math.sqrt(hx * hx + hy * hy + hz * hz)
        spare = room * pad.normal - mass * (hx * px + hy * py + hz * pz + half * (ux * ky - uy * kx))
        lack = max(lack, size * wanted - spare) if room > 0.0 else UNBOUNDED
        if spare < best * size:
            best, wx, wy, wz = spare / size, hx, hy, hz
    length = math.sqrt(wx * wx + wy * wy + wz * wz)
    for j in range(3):
        direction[j] = -(pad.turn[0, j] * wx + pad.turn[1, j] * wy + pad.turn[2, j] * wz) / length
    return max(best, 0.0), min(lack, UNBOUNDED)


@compiled
def worst_turn(pad: HeldPad, gravity_now: Array, gravity_mps2: float, out: Array) -> float:
    """Find the orientation at rest in which a pad's utilisation is largest.

    Args:
        pad: The pad.
        gravity_now: Apparent gravity at the centre of mass under the load now, in the gripper frame, shape (3,), m/s².
        gravity_mps2: Length of gravity, m/s².
        out: Filled with gravity in that orientation, in the gripper frame, shape (3,), m/s².

    Returns:
        About the utilisation; `pad_utilisation` has it with the worst of what is not known.

    The utilisation is a ratio of two linear functions for each half-space, so Dinkelbach's method finds its largest
    value; two steps suffice, because the normal force changes little.
    """
    gx, gy, gz = turned(pad.turn, gravity_now[0], gravity_now[1], gravity_now[2])
    lx, ly, lz = pad.lever[0], pad.lever[1], pad.lever[2]
    mass, fx, fy, m = pad.mass[1], pad.load[0], pad.load[1], pad.load[2] * pad.spin_scale
    twists, edges = pad.twists.shape[1], pad.edges.shape[1]
    best, bx, by, bz = -UNBOUNDED, 1.0, 0.0, 0.0
    for k in range(twists + edges):
        for corner in range(8 if k < twists else 1):
            if k < twists:
                sign = 1.0 if corner % 2 == 0 else -1.0
                share, part = pad.shares[(corner // 2) % 2], pad.spin_shares[corner // 4]
                qx, qy, qw = sign * pad.twists[0, k], sign * pad.twists[1, k], sign * pad.twists[2, k]
                turns = part * qw * pad.spin_scale
                hx, hy, hz = share * qx - turns * ly, share * qy + turns * lx, 0.0
                fixed, offset = qx * fx + qy * fy + qw * m + pad.twists[3, k], 0.0
            else:
                left = pad.edges[3, k - twists]
                ux, uy = left * pad.edges[0, k - twists], left * pad.edges[1, k - twists]
                hx, hy, hz = 0.5 * ux * lz, 0.5 * uy * lz, -0.5 * (ux * lx + uy * ly)
                fixed, offset = 0.0, pad.edges[2, k - twists]
            used = 0.0
            for _ in range(2):
                lift = hz + 0.5 * used
                size = gravity_mps2 / max(math.sqrt(hx * hx + hy * hy + lift * lift), 1e-12)
                vx, vy, vz = size * hx, size * hy, size * lift
                normal = pad.normal - 0.5 * mass * (vz - gz)
                load = fixed + mass * (hx * (vx - gx) + hy * (vy - gy) + hz * (vz - gz))
                used = load / normal if normal > 0.0 else UNBOUNDED
            if used + offset > best:
                best, bx, by, bz = used + offset, vx, vy, vz
    for j in range(3):
        out[j] = pad.turn[0, j] * bx + pad.turn[1, j] * by + pad.turn[2, j] * bz
    return best
