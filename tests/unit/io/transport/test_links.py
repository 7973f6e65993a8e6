from __future__ import annotations

import asyncio
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from slipd.events import LinkSpec
from slipd.io.transport import Links

if TYPE_CHECKING:
    from conftest import Serving

PORT = LinkSpec("left.wrench", "serial", "/nowhere/at/all", 115200)


async def test_an_unknown_transport_is_refused_before_anything_opens() -> None:
    async with asyncio.TaskGroup() as tasks:
        with pytest.raises(ValueError, match=r"transport must be serial, tcp, udp, .* got 'carrier pigeon'"):
            Links(tasks, [PORT, LinkSpec("right.wrench", "carrier pigeon", "roof")], print)


async def test_two_links_with_the_same_name_are_refused() -> None:
    async with asyncio.TaskGroup() as tasks:
        with pytest.raises(ValueError, match=r"link names must differ, got 'left.wrench' twice"):
            Links(tasks, [PORT, PORT], print)


async def test_a_write_to_an_unknown_link_is_refused_with_the_known_names(serving: Serving) -> None:
    async with serving(PORT) as (links, _):
        with pytest.raises(ValueError, match=r"link must be one of left.wrench, got 'left'"):
            links.write("left", b"x")


async def test_each_link_has_one_task_with_its_name(serving: Serving) -> None:
    async with serving(PORT, LinkSpec("gripper", "serial", "/nowhere/either", 115200)):
        names = {task.get_name() for task in asyncio.all_tasks()}
        assert {"link left.wrench", "link gripper"} <= names


async def test_every_task_has_ended_when_the_links_have() -> None:
    async with asyncio.TaskGroup() as tasks:
        async with Links(tasks, [PORT], print):
            await asyncio.sleep(0)
        assert not [task for task in asyncio.all_tasks() if task.get_name().startswith("link ")]


async def test_a_rig_without_links_is_served_too(serving: Serving) -> None:
    async with serving() as (links, _):
        assert links.refused_writes == {}


def test_no_library_is_loaded_for_a_transport_that_is_not_used() -> None:
    code = "import sys, slipd.io.transport; print({'websockets', 'serial', 'zmq'} & set(sys.modules))"
    told = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=Path.cwd())
    assert told.stdout.strip() == "set()"
