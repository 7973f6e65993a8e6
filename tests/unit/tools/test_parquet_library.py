from __future__ import annotations

import sys

import pytest

from slipd.errors import SlipdError
from slipd.tools.parquet_library import parquet_library


def test_without_pyarrow_the_error_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(SlipdError, match=r"--table needs the package pyarrow: pip install 'slipd\[batch\]'"):
        parquet_library("--table", "batch")
    with pytest.raises(SlipdError, match=r"--to lerobot needs the package pyarrow: pip install 'slipd\[parquet\]'"):
        parquet_library("--to lerobot")
