"""The wheels hold all that a machine without the repository needs, and run there."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import sysconfig
import venv
from email.parser import Parser
from pathlib import Path
from zipfile import ZipFile

import pytest
from project import CONFIG, DAEMON, DOCS, ROOT

from slipd import __version__

pytestmark = pytest.mark.process

CLIENT = ROOT / "clients" / "slipd_client"
PIP = [sys.executable, "-m", "pip", "--disable-pip-version-check"]


def run(*command: str | Path, folder: Path, **variables: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        command, cwd=folder, env=os.environ | variables, capture_output=True, text=True, check=False, timeout=100
    )


@pytest.fixture(scope="module")
def wheels(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Wheels by the name of their project, built as ``make dist`` builds them."""
    (line,) = re.findall(r"pip (wheel .*) --wheel-dir dist (.*)$", (ROOT / "Makefile").read_text(), re.MULTILINE)
    out = tmp_path_factory.mktemp("dist")
    done = run(*PIP, *line[0].split(), "--wheel-dir", out, *line[1].split(), folder=ROOT)
    assert done.returncode == 0, done.stderr
    return {path.name.partition("-")[0]: path for path in out.iterdir()}


@pytest.fixture(scope="module")
def installed(wheels: dict[str, Path], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The commands of slipd in an environment of their own, which borrows only the dependencies from this one."""
    home = tmp_path_factory.mktemp("robot") / "venv"
    venv.create(home, symlinks=True)
    packages = home / "lib" / f"python{sys.version_info[0]}.{sys.version_info[1]}" / "site-packages"
    (packages / "dependencies.pth").write_text(sysconfig.get_path("purelib"), encoding="utf-8")
    install = ("install", "--quiet", "--no-deps", "--no-index", "--no-compile", "--ignore-installed")
    done = run(*PIP, "--python", home / "bin" / "python", *install, wheels["slipd"], folder=home)
    assert done.returncode == 0, done.stderr
    return home / "bin"


def contents(wheel: Path) -> dict[str, bytes]:
    with ZipFile(wheel) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def files_of(folder: Path, below: str) -> dict[str, bytes]:
    """Return the files of a folder by the name that they have in a wheel."""
    files = [path for path in folder.rglob("*") if path.is_file() and "__pycache__" not in path.parts]
    return {f"{below}/{path.relative_to(folder).as_posix()}": path.read_bytes() for path in files}


def test_the_daemon_s_wheel_holds_daemon_client_configs_and_docs_and_nothing_else(wheels: dict[str, Path]) -> None:
    expected = files_of(DAEMON, "slipd") | files_of(CLIENT, "slipd_client")
    expected |= files_of(CONFIG, "slipd/shipped/config") | files_of(DOCS, "slipd/shipped/docs")
    expected = {name: data for name, data in expected.items() if "/docs/measured/" not in name}
    expected["slipd/shipped/README.md"] = (ROOT / "README.md").read_bytes()
    held = contents(wheels["slipd"])
    assert {name: data for name, data in held.items() if ".dist-info/" not in name} == expected
    for needed in ("slipd/shipped/config/slipd.service", "slipd_client/page/assets/index.html", "slipd/py.typed"):
        assert needed in held


def test_the_client_s_wheel_holds_the_client_alone(wheels: dict[str, Path]) -> None:
    held = contents(wheels["slipd_client"])
    assert {name: data for name, data in held.items() if ".dist-info/" not in name} == files_of(CLIENT, "slipd_client")


@pytest.mark.parametrize(("name", "python"), [("slipd", ">=3.11"), ("slipd_client", ">=3.10")])
def test_a_wheel_needs_no_compiler_and_states_version_and_licence(
    name: str, python: str, wheels: dict[str, Path]
) -> None:
    assert wheels[name].name == f"{name}-{__version__}-py3-none-any.whl"
    files = contents(wheels[name])
    ends = (".dist-info/METADATA", "/licenses/LICENSE")
    (metadata,), (licence,) = ([data for file, data in files.items() if file.endswith(end)] for end in ends)
    stated = Parser().parsestr(metadata.decode())
    keys = ("Version", "License-Expression", "Requires-Python")
    assert [stated[key] for key in keys] == [__version__, "Apache-2.0", python]
    assert licence == (ROOT / "LICENSE").read_bytes()


def own_unit(name: str, installed: Path) -> str:
    """A unit that starts the installed program."""
    return (CONFIG / name).read_text(encoding="utf-8").replace("/opt/slipd/bin", str(installed))


def test_an_installed_slipd_works_outside_the_repository(installed: Path, tmp_path: Path) -> None:
    shipped, external = installed.parent / "lib", (CONFIG / "external.toml").read_text(encoding="utf-8")
    (tmp_path / "my_rig.toml").write_text(external, encoding="utf-8")
    for command, expected in (
        (["--version"], f"slipd {__version__}"),
        (["config", "list"], f"{shipped}/"),
        (["config", "show", "external"], external),
        (["check", "my_rig.toml"], "left.wrench"),
        (["service", "show", "slipd.service"], own_unit("slipd.service", installed)),
        (["service", "install", "--user"], ""),
        (["docs"], f"{shipped}/"),
        (["docs", "physics"], (DOCS / "physics.md").read_text(encoding="utf-8")),
    ):
        done = run(installed / "slipd", *command, folder=tmp_path, XDG_CONFIG_HOME=str(tmp_path))
        assert (done.returncode, done.stderr) == (0, ""), command
        assert done.stdout.startswith(expected), command
    unit = tmp_path / "systemd/user/slipd.service"
    assert unit.read_text(encoding="utf-8") == own_unit("slipd-user.service", installed)
    asked = run(installed / "slipctl", "status", folder=tmp_path, SLIPD_RUNTIME_DIR=str(tmp_path))
    assert (asked.returncode, "Traceback" in asked.stderr) == (1, False)
