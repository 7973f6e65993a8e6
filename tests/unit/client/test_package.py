from __future__ import annotations

import pkgutil
import subprocess
import sys

import slipd_client


def test_a_subscriber_loads_no_asyncio() -> None:
    code = "import sys, slipd_client.subscriber, slipd_client.slipctl_parser; print('asyncio' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "False\n"


def test_importing_the_whole_client_loads_nothing_heavy_and_nothing_of_the_daemon() -> None:
    modules = [module.name for module in pkgutil.walk_packages(slipd_client.__path__, "slipd_client.")]
    code = f"""
import importlib, sys
for name in {modules}:
    importlib.import_module(name)
print(sorted({{"numpy", "scipy", "numba", "pydantic", "slipd"}} & set(sys.modules)))
"""
    assert {"slipd_client.slipctl", "slipd_client.aio", "slipd_client.messages.codec"} <= set(modules)
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"
