"""Python runs this first in each process that a test starts."""

from __future__ import annotations

from mutate.children import begin

begin()
