# SPDX-License-Identifier: GPL-3.0-or-later
"""Nothing leaves this computer: Blender's switch for the internet need not be asked for."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

from octo_motion.device.stream import LOOPBACK

PACKAGE = Path(__file__).resolve().parents[2] / "octo_motion"
NETWORK = {
    *("asyncio", "ftplib", "http", "requests", "smtplib", "socket", "socketserver", "ssl"),
    *("urllib", "urllib3", "webbrowser", "xmlrpc"),
}
# Python tells of every address, whoever uses it.
WATCHED = """
import sys
def told(event, given):
    if event in {"socket.bind", "socket.connect", "socket.sendto", "socket.getaddrinfo"}:
        address = given[0] if event.endswith("info") else given[1]
        sys.stderr.write(f"address {address if isinstance(address, str) else address[0]}\\n")
sys.addaudithook(told)
from octo_motion.device.__main__ import main
sys.exit(main(sys.argv[1:]))
"""


def imported(path: Path) -> set[str]:
    """The packages that a module imports from outside."""
    tree = ast.parse(path.read_bytes())
    names = {
        each.name for node in ast.walk(tree) if isinstance(node, ast.Import) for each in node.names
    }
    names |= {
        node.module or ""
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom) and not node.level
    }
    return {name.partition(".")[0] for name in names}


def test_devices_alone_use_the_network() -> None:
    users = {path for path in PACKAGE.rglob("*.py") if imported(path) & NETWORK}
    assert users
    assert {path.relative_to(PACKAGE).parts[0] for path in users} == {"device"}


def test_program_at_the_devices_talks_to_this_computer_alone(tmp_path: Path) -> None:
    options = ["watch", "--seconds", "0.5", "--simulate"]
    for kind in ("tcp", "udp"):
        words = [*options, f"--{kind}", "0", "--key-file", str(tmp_path / "key")]
        run = subprocess.run(
            [sys.executable, "-X", "utf8", "-c", WATCHED, *words],
            cwd=PACKAGE.parent,
            capture_output=True,
            encoding="utf-8",
            check=True,
        )
        lines = run.stderr.splitlines()
        found = {line.partition(" ")[2] for line in lines if line.startswith("address ")}
        # The port for programs is opened, and Haply's service looked for.
        assert found == {LOOPBACK}
