from __future__ import annotations

from collections.abc import Iterator

import pytest

pytest.importorskip("zenoh", reason="needs eclipse-zenoh, the extra `fleet`")

from zenoh_peers import Router


@pytest.fixture(scope="session")
def router() -> Iterator[Router]:
    with Router() as router:
        yield router
