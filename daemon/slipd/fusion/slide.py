"""A slip that the load shows: its begin, its plateau, and its end.

Friction of a moving object stays on a plateau that its speed and place change slowly. When the object stops, q follows
the load again and leaves the plateau, sooner or later. A load that stays exactly there shows nothing, so a slip ends
without new evidence after ``hold_s``.
"""

from __future__ import annotations

import math

from slipd.fusion.compiled import compiled_part
from slipd.fusion.load_blocks import CHANGES, STDS, mean_q, noise_of, vibration
from slipd.fusion.rows import Row, Rows

SWINGS = 2.0
"""A fall or jump is at least so many times the largest swing of the last second."""
NEAR, FROM = 0.95, 0.68
"""From NEAR of it on, q is near the largest that the grasp carried without motion, or near the coefficient of friction.
A fall begins near the former, and a jump goes as far beyond it. No slow fall and no jump counts below FROM of a
coefficient of friction that is known."""
MOST_DROP, SHALLOW = 0.38, 0.25
"""Parts of q. A slip falls by at most MOST_DROP: dynamic friction is rarely less, and a load that is let go falls
further. A fall of less than SHALLOW is shallow."""
FLAT = 0.15
"""A plateau changes by at most this part of the fall or lag, and scatters by no more beyond its noise: a swing does."""
SLIGHT = 0.08
"""What is at most this part of a fall or jump counts as nothing: the bend, the ringing, and the noise of a plateau, and
the distance of a fall from the top."""
BACK = 0.35
"""A rise by more than this part of a fall makes it a push, or a swing."""
LEAST_RISE = 0.007
"""Before a fall, q rose by at least this part of itself; a load went on if it changed by more."""
SETTLES_S = 0.05
"""A slip is reported for at least this time, and may settle on a lower plateau meanwhile, s. Later the plateau follows
q with this time constant, for friction depends on speed and place."""


@compiled_part
def begin_slide(drop: Row, t_s: float, peak: float, plateau: float, most: float, surprise: float) -> None:
    """Begin a slip.

    Args:
        drop: State, a row of DROP.
        t_s: Now, s.
        peak: q before it; NaN where the load did not fall.
        plateau: q while it slides.
        most: A larger q is carried without motion.
        surprise: −ln of the probability of what was seen by noise alone.
    """
    drop["sliding"], drop["since_s"], drop["most"] = True, t_s, most
    drop["peak"], drop["plateau"], drop["surprise"] = peak, plateau, surprise


@compiled_part
def follow_slide(drop: Row, ring: Rows, t_s: float) -> None:
    """Follow the plateau while the object slides, and end the slip where q leaves it or nothing new shows motion."""
    plateau, age, dt = drop["plateau"], t_s - drop["since_s"], drop["dt"]
    short = mean_q(ring, drop["block"], min(3, drop["count"]))
    if age < SETTLES_S and (1.0 - MOST_DROP) * drop["most"] < short < plateau:
        drop["plateau"] += (short - plateau) * dt / (0.1 * SETTLES_S + dt)
        return
    band = STDS * (noise_of(drop) / math.sqrt(3.0) + vibration(drop, drop["rough"]))
    band = max(CHANGES * plateau, band)
    if abs(short - plateau) > band or short > drop["most"] + 0.5 * band:
        if age >= SETTLES_S:
            _end(drop, short)
    elif age > drop["hold_s"]:
        _end(drop, short)
    else:
        drop["plateau"] += (short - plateau) * dt / (SETTLES_S + dt)


@compiled_part
def _end(drop: Row, short: float) -> None:
    """End a slip: what the grasp carries without motion is to be learned anew."""
    drop["sliding"] = False
    drop["top"], drop["smooth"], drop["carried"] = drop["plateau"], short, short
    drop["crest"], drop["trough"] = short, short


@compiled_part
def surprise_of(change: float, std: float) -> float:
    """Return −ln of the probability that Gaussian noise exceeds a change; 0 for one within its standard deviation.

    Source: leading term of the tail, exp(−z²/2) / (z √(2π)).
    """
    if change <= std:
        return 0.0
    if std == 0.0:
        return math.inf
    deviations = change / std
    return 0.5 * deviations * deviations + math.log(deviations) + 0.919
