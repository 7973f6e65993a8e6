"""The shipped configs and docs are found by name."""

from __future__ import annotations

import re

import pytest
from project import CONFIG, DOCS, ROOT

from slipd.errors import SlipdError
from slipd.tools.shipped_files import config_files, page_file, pages, shipped_config, system_file, system_files


def test_every_file_is_listed_configs_apart_from_those_of_the_system() -> None:
    found = {path.resolve() for path in [*config_files(), *system_files()]}
    assert found == {path for path in CONFIG.rglob("*") if path.is_file()}
    assert {path.suffix for path in config_files()} == {".toml"}


@pytest.mark.parametrize("name", ["demo", "demo.toml"])
def test_a_config_is_found_with_and_without_its_suffix(name: str) -> None:
    assert shipped_config(name).samefile(CONFIG / "demo.toml")


def test_a_file_of_the_system_is_no_config_and_found_as_what_it_is() -> None:
    assert system_file("slipd.service") == system_file("slipd") == next(CONFIG.rglob("slipd.service"))
    with pytest.raises(SlipdError, match=r"slipd service show slipd\.service"):
        shipped_config("slipd.service")


def test_every_page_is_listed_readme_first() -> None:
    assert next(iter(pages().values())).samefile(ROOT / "README.md")
    assert {path.resolve() for path in pages().values()} == {ROOT / "README.md", *DOCS.rglob("*.md")}
    assert pages()["measured/peers"].samefile(DOCS / "measured" / "peers.md")


@pytest.mark.parametrize("name", ["physics", "physics.md", "docs/physics.md"])
def test_a_page_is_found_by_every_way_to_write_it(name: str) -> None:
    assert page_file(name).samefile(DOCS / "physics.md")


@pytest.mark.parametrize("name", ["", "../../etc/passwd", "/etc/passwd", "zzzzzz", "\0"])
def test_an_unknown_name_is_refused_with_the_known_ones_and_a_misspelt_one_with_the_nearest(name: str) -> None:
    for find, wrong, told in (
        (shipped_config, name, f"there is no config {name!r}; known: bota_xela, demo, "),
        (page_file, name, f"there is no page {name!r}; known: README, "),
        (shipped_config, "netft_wst", "there is no config 'netft_wst'; did you mean 'netft_wts'?"),
        (system_file, "slipd.servic", "there is no file 'slipd.servic'; did you mean 'slipd.service'?"),
    ):
        with pytest.raises(SlipdError, match=re.escape(told)):
            find(wrong)
