"""Contacts on which methods fail, one for each way: the rows of the failure atlas and of its tests.

Limits are closed forms where there is one: at a known pole, a hinge among them, Φ itself; on few taxels a triangle of
forces. The other numbers are frozen from `chart.reference`, which the atlas asks again.
"""

from __future__ import annotations

from chart import failing_loads, failing_shapes
from chart.finds import AGAINST_OTHERS, AGAINST_OURS
from chart.row import Row

GROUPS: dict[str, list[Row]] = {
    "Nothing special": failing_shapes.nothing_special(),
    "The pole is a taxel, or all but one": failing_shapes.pole_at_a_taxel(),
    "One taxel, two, three": failing_shapes.few_taxels(),
    "On a line": failing_shapes.on_a_line(),
    "Unequal loads; doubled, saturated and dead taxels": failing_loads.unequal_loads(),
    "R near μ: the pole runs to infinity": failing_loads.near_translation(),
    "C beside the load centroid": failing_loads.beside_the_centroid(),
    "Units and places": failing_loads.units_and_places(),
    "No contact, or no data": failing_loads.no_answer(),
    "Found by search: the worst of the other methods": AGAINST_OTHERS,
    "Found by search: slipd while it was made": AGAINST_OURS,
}

ROWS: tuple[Row, ...] = tuple(row for rows in GROUPS.values() for row in rows)
