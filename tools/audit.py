"""Is something known against the packages that are installed, and are they still as they were installed?

    python tools/audit.py

Every file of a package is compared with the hash that the package brought; that needs nobody. pip-audit asks
a service for known vulnerabilities. Where none can be reached that is said, and is no failure: whoever must
know runs it where there is one.
"""

from __future__ import annotations

import base64
import hashlib
import json
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from importlib import metadata
from pathlib import Path
from typing import Any

#: How pip-audit is told whom to ask, in the order of trying.
SERVICES = (("--vulnerability-service", "pypi"), ("--vulnerability-service", "osv"))
#: What every service knows: it is asked for this first, so that one that is not there costs one question. It
#: comes with the environment, and we do not depend on it: what is known against it is left out.
PROBE = "pip"
PATIENCE_S = 600


def changed(packages: Iterable[metadata.Distribution]) -> Iterator[str]:
    """Yield what is not as it was installed."""
    for package in packages:
        for file in package.files or ():
            path = Path(str(file.locate()))
            # Scripts in bin name the interpreter, and are written anew when an environment moves.
            if file.hash is None or ".." in file.parts or file.suffix == ".pyc" or not path.is_file():
                continue
            found = hashlib.new(file.hash.mode, path.read_bytes()).digest()
            if base64.urlsafe_b64encode(found).rstrip(b"=").decode() != file.hash.value:
                yield f"{package.name} {package.version}: {file} was changed after it was installed"


def asked(packages: Iterable[str], service: Sequence[str]) -> list[dict[str, Any]]:
    """Return what pip-audit says of packages, `NAME==VERSION` each.

    Raises:
        ConnectionError: the service, or pip-audit itself, is not there.
    """
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "packages.txt")
        file.write_text("".join(f"{package}\n" for package in packages), encoding="utf-8")
        options = ["--requirement", str(file), "--no-deps", "--disable-pip", "--format", "json"]
        quiet = ["--progress-spinner", "off", "--timeout", "10", "--cache-dir", str(Path(folder, "cache"))]
        command = [sys.executable, "-m", "pip_audit", *options, *quiet, *service]
        try:
            done = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE_S, check=False)
            found: list[dict[str, Any]] = json.loads(done.stdout)["dependencies"]
        except subprocess.TimeoutExpired:
            raise ConnectionError(f"no answer within {PATIENCE_S} s") from None
        except (ValueError, LookupError):
            said = done.stderr.strip().splitlines() or ["it says nothing"]
            raise ConnectionError(said[-1][:300]) from None
    return found


def first_that_answers(services: Iterable[Sequence[str]]) -> Sequence[str] | None:
    """Return the first service that knows something; tell why the others are no help."""
    for service in services:
        try:
            (probe,) = asked([f"{PROBE}=={metadata.version(PROBE)}"], service)
            problem = probe.get("skip_reason", "")
        except ConnectionError as error:
            problem = str(error)
        if not problem:
            return service
        print(f"audit: {service[-1]} cannot be asked: {problem}")
    return None


def vulnerabilities(packages: Iterable[str], service: Sequence[str]) -> list[str]:
    """Return what is known against packages; tell which ones the service does not know."""
    found = asked(packages, service)
    unknown = [one["name"] for one in found if "skip_reason" in one]
    print(f"audit: {len(found) - len(unknown)} packages looked up; {len(unknown)} not known: {unknown}")
    return [
        f"{one['name']} {one['version']}: {each['id']}, fixed in {', '.join(each['fix_versions']) or 'none'}"
        for one in found
        for each in one.get("vulns", ())
    ]


def main(services: Iterable[Sequence[str]] = SERVICES) -> int:
    """Look, tell, and return 1 when something is wrong."""
    packages = sorted(metadata.distributions(), key=lambda one: one.name.lower())
    wrong = list(changed(packages))
    print(f"audit: files of {len(packages)} packages compared with their hashes; {len(wrong)} changed")
    service = first_that_answers(services)
    if service is None:
        print("audit: KNOWN VULNERABILITIES WERE NOT LOOKED UP: no service could be asked")
    else:
        named = [f"{one.name}=={one.version}" for one in packages if one.name != PROBE]
        wrong += vulnerabilities(named, service)
    print(*wrong, sep="\n", end="\n" if wrong else "")
    print(f"audit: {len(wrong)} problems" + ("" if service else ", vulnerabilities not looked up"))
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main([("--vulnerability-service", "osv", "--osv-url", url) for url in sys.argv[1:]] or SERVICES))
