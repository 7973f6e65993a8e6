"""Kinds of evidence travel as a bit mask; their order is a contract between the rooms."""

from __future__ import annotations

import itertools

from slipd.motion.evidence import EVIDENCE, evidence_mask, evidence_names


def test_the_order_of_the_kinds_is_fixed() -> None:
    assert EVIDENCE == ("load_drop", "image_change", "spin_change", "vibration", "width", "external")


def test_a_mask_names_its_kinds_in_order() -> None:
    for count in range(len(EVIDENCE) + 1):
        for kinds in itertools.combinations(EVIDENCE, count):
            assert evidence_names(evidence_mask(*kinds)) == kinds
            assert evidence_names(evidence_mask(*reversed(kinds), *kinds)) == kinds
