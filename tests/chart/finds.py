"""Contacts found by search, frozen: the worst of each method, in few digits so that they can be read."""

from __future__ import annotations

from chart.row import Row

FINDS: list[Row] = []
