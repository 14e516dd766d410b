"""python -m equipoise_tools.sbom --version V --out FILE [PACKAGE.deb...]

Software bill of materials, CycloneDX 1.5: what the packages are linked with (their Depends), which Python
packages build and test them, and which JavaScript the cockpit serves. Nothing is vendored.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import re
import subprocess
import uuid
from datetime import UTC, datetime
from pathlib import Path

from .entry import leave
from .paths import repository_root


def component(name: str, version: str, purl: str, scope: str) -> dict:
    return {"type": "library", "name": name, "version": version, "purl": purl, "scope": scope}


def of_debian(package: Path) -> list[dict]:
    """Depends of a package: the alternatives' first, with the version that it asks for."""
    command = ["dpkg-deb", "--field", str(package), "Depends"]
    depends = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    found = []
    for entry in depends.split(","):
        match = re.match(r"\s*([a-z0-9.+-]+)(?::\w+)?\s*(?:\(([<>=]+ [^)]+)\))?", entry)
        if match:
            name, version = match[1], match[2] or ""
            found.append(component(name, version, f"pkg:deb/debian/{name}", "required"))
    return found


def of_python(requirements: Path) -> list[dict]:
    found = []
    for line in requirements.read_text(encoding="utf-8").splitlines():
        match = re.match(r"([A-Za-z0-9._-]+)(?:\[[^\]]*\])?==([\w.]+)", line)
        if match:
            name, version = match[1].lower(), match[2]
            found.append(component(name, version, f"pkg:pypi/{name}@{version}", "optional"))
    return found


def of_npm(lock: Path) -> list[dict]:
    packages = json.loads(lock.read_text(encoding="utf-8"))["packages"]
    found = []
    for path, entry in packages.items():
        if path:
            name = path.removeprefix("node_modules/")
            found.append(component(name, entry["version"], f"pkg:npm/{name}@{entry['version']}", "optional"))
    return found


def bill(version: str, packages: list[Path], root: Path, when: datetime) -> dict:
    parts = [item for package in packages for item in of_debian(package)]
    parts += of_python(root / "tools/requirements.txt") + of_npm(root / "tools/page/package-lock.json")
    unique = {item["purl"]: item for item in parts}
    components = [unique[purl] for purl in sorted(unique)]
    named = hashlib.sha256(json.dumps([version, components]).encode()).hexdigest()
    return {
        "bomFormat": "CycloneDX",
        "specVersion": "1.5",
        "serialNumber": f"urn:uuid:{uuid.uuid5(uuid.NAMESPACE_OID, named)}",
        "version": 1,
        "metadata": {
            "timestamp": when.strftime("%Y-%m-%dT%H:%M:%SZ"),
            "component": {
                "type": "application",
                "name": "equipoise",
                "version": version,
                "licenses": [{"license": {"id": "BSD-3-Clause"}}],
            },
        },
        "components": components,
    }


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="python -m equipoise_tools.sbom", description=__doc__)
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.add_argument("packages", nargs="*", type=Path, metavar="PACKAGE.deb")
    parser.add_argument("--version", required=True)
    parser.add_argument("--out", type=Path, required=True)
    given = parser.parse_args(arguments)
    when = datetime.fromtimestamp(int(os.environ.get("SOURCE_DATE_EPOCH", "0")), UTC)
    text = json.dumps(bill(given.version, given.packages, repository_root(), when), indent=1)
    given.out.write_text(text + "\n", encoding="utf-8")
    print(given.out)
    return 0


if __name__ == "__main__":
    leave(main)
