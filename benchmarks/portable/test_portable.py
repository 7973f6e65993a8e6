"""A share of the numeric tests as on a processor without vector instructions; ``make portable`` runs all."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest
from project import MODULES


@pytest.mark.process
@pytest.mark.timeout(600)
def test_the_numeric_tests_pass_as_on_the_oldest_processor() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "portable", "--quick"],
        env=os.environ | {"PYTHONPATH": MODULES},
        stdout=subprocess.PIPE,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout
