"""Contacts found by search, frozen: the worst of each method, in few digits so that they can be read."""

from __future__ import annotations

from collections.abc import Sequence

from chart.row import Row, contact

Values = Sequence[float]


def found(name: str, why: str, x: Values, y: Values, loads: Values, force: Values, limit_nm: float) -> Row:
    """A find, about the load centroid; the limit from ``chart.reference``."""
    return Row(name, why, contact(x, y, loads, force), limit_nm)


FINDS: list[Row] = [
    found(
        "heavy taxel on the way",
        "The heaviest taxel lies between the centroid and the pole, and is not the hinge.",
        [0.0062, -0.0029, 0.0066, -0.0073],
        [0.0025, -0.0033, 0.0016, -0.0059],
        [0.033, 0.021, 0.41, 0.011],
        (0.2, 0.074),
        0.0001844579230243847,
    ),
    found(
        "on the verge, 1 − ρ = 0.1",
        "A light taxel is a hinge to within a thousandth, the heavy one draws the search away.",
        [-0.00662794787, -0.00612513509, -0.00357694719, -0.000946423559],
        [0.00190311051, 0.00109727053, -0.00617627921, 0.0092897936],
        [0.0177546739, 0.702278887, 0.0504805114, 0.0402852461],
        (0.298014409, 0.211768835),
        0.0002984386570122207,
    ),
    found(
        "1 − ρ = 1.5e-6, pole near",
        "So close to translation the pole is still within the contact: its distance tells nothing.",
        [-0.00428871647, 0.00437591389, -0.00821124843, -0.00919703922],
        [0.00340264703, 0.00421180967, 0.00270667232, 0.000911486649],
        [0.241097306, 0.425539447, 0.12614022, 0.0508475513],
        (-0.0717668523, 0.415661597),
        3.270555359163821e-07,
    ),
    found(
        "pole between two decades",
        "A thousandth of the load decides where the pole is, 1e-4 from translation.",
        [0.00698415, -0.00168081, -0.00128904, 0.00903453],
        [-0.00465395, -0.00303055, 0.00853226, -0.00038655],
        [0.0178591, 3.22333e-10, 0.000124218, 3.74163e-09],
        (0.00745441, 0.0050213),
        6.90560414929482e-08,
    ),
    found(
        "thin, 1e-11",
        "Width 1e-8 of the length: a step across is below rounding along.",
        [0.007329, -0.004999, -0.003911, 0.007142],
        [4.828e-12, 2.461e-11, -4.416e-11, -3.29e-13],
        [0.7076, 0.7081, 0.8464, 0.1658],
        (0.03987, 1.144),
        0.0003358531674559684,
    ),
    found(
        "thin, 1e-3",
        "Width a thousandth of the length, and four of them from the pole to a taxel.",
        [-0.0005004, -0.0003342, 0.007885, 0.008803],
        [8.159e-06, 1.774e-06, 1.326e-05, 9.953e-06],
        [0.2742, 0.2477, 0.7, 0.1107],
        (0.1779, -0.635),
        9.457341707314116e-05,
    ),
    found(
        "four scales",
        "Four taxels at distances of 8 mm, 74 µm, 270 nm and 2 nm: the pole at each.",
        [0.0023, 4.9e-05, 2.2e-07, 6.3e-10],
        [-0.0079, 5.5e-05, 1.5e-07, 1.6e-09],
        [0.044, 0.0089, 0.13, 0.089],
        (-0.04, 0.1),
        0.00019503223032752248,
    ),
    found(
        "four scales, pole 2 µm off",
        "As before, the pole beside the third.",
        [0.008861, 4.945e-05, 2.676e-07, 1.627e-09],
        [-0.00669, -1.874e-05, 1.983e-07, -1.554e-09],
        [0.5, 0.03449, 0.2667, 0.4667],
        (0.543, 0.09711),
        0.000990760196620837,
    ),
    found(
        "thin, hinge",
        "A hinge on a contact that is a line to 1e-4.",
        [0.0015, 0.0081, -0.0079, -0.0078],
        [-1.1e-06, 1.7e-06, 1.1e-06, -1.8e-06],
        [0.1, 0.14, 0.39, 0.89],
        (0.16, 0.65),
        0.00023630509039829586,
    ),
    found(
        "four scales, near R = μ",
        "As before, with 1 − ρ = 0.005.",
        [-0.0043, 2.9e-06, -7.3e-10, 3.4e-13],
        [0.0076, -1.9e-06, -1.2e-10, -5.5e-13],
        [0.0022, 0.02, 0.055, 0.072],
        (0.067, 0.032),
        3.4542421810290197e-06,
    ),
    found(
        "seven decades, 1 − ρ = 5e-12",
        "What is left of the torque is carried by a ten-millionth of the load.",
        [-0.004275547298961474, 0.006711061655014295, 0.008697232264817818, 0.004836894255157384],
        [-0.006882313595562399, -0.0030951906342480493, -0.0031218029465096067, -0.004870874932996595],
        [6.274582237238696e-10, 6.642664280432642e-09, 1.4290300007862971e-10, 0.0322092881779904],
        (0.0006169202752284122, -0.01609282728388461),
        4.02224115500825e-14,
    ),
]
