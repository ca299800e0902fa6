"""Fetches the libraries of the page from the npm registry, by the versions and hashes of `manifest.json`.

What it fetches is committed, so that neither an installation nor a run needs a network. To take another version,
change version and integrity in the manifest (`npm view NAME@VERSION dist.integrity`), run this with `--pin`, and read
the diff.
"""

import argparse
import base64
import hashlib
import io
import json
import sys
import tarfile
import urllib.request
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent
MANIFEST = HERE / "manifest.json"
REGISTRY = "https://registry.npmjs.org/{name}/-/{name}-{version}.tgz"


def integrity(data: bytes) -> str:
    """As npm and browsers write it."""
    return "sha512-" + base64.b64encode(hashlib.sha512(data).digest()).decode()


def manifest() -> list[dict[str, Any]]:
    """Libraries: name, version, licence, integrity of the package, files."""
    libraries: list[dict[str, Any]] = json.loads(MANIFEST.read_text(encoding="utf-8"))
    return libraries


def download(library: dict[str, Any]) -> bytes:
    """The package as published.

    Raises:
        ValueError: it is not the one that the manifest names.
    """
    address = REGISTRY.format(**library)
    with urllib.request.urlopen(address, timeout=60) as answer:  # noqa: S310 - https, by the constant above
        package: bytes = answer.read()
    if integrity(package) != library["integrity"]:
        raise ValueError(f"{address}: expected {library['integrity']}, got {integrity(package)}")
    return package


def extract(library: dict[str, Any], package: bytes) -> dict[str, bytes]:
    """The files that the page needs, by the name they have here."""
    found = {}
    with tarfile.open(fileobj=io.BytesIO(package), mode="r:gz") as archive:
        for entry in library["files"]:
            member = archive.extractfile(f"package/{entry['from']}")
            if member is None:
                raise ValueError(f"{library['name']}: {entry['from']}: expected a file")
            data = member.read()
            for old, new in entry.get("replace", []):
                if data.count(old.encode()) != 1:
                    raise ValueError(f"{library['name']}: {entry['from']}: expected {old!r} once")
                data = data.replace(old.encode(), new.encode())
            found[entry["as"]] = data
    return found


def faults() -> list[str]:
    """What differs between the files that are here and the manifest, a line each."""
    complaints = []
    for library in manifest():
        for entry in library["files"]:
            path = HERE / entry["as"]
            if not path.is_file():
                complaints.append(f"{path.name}: missing")
            elif integrity(path.read_bytes()) != entry["integrity"]:
                complaints.append(f"{path.name}: not the file of {library['name']} {library['version']}")
    return complaints


def fetch(*, pin: bool) -> None:
    """Replace the files that are here; with `pin`, write their hashes into the manifest."""
    libraries = manifest()
    for library in libraries:
        found = extract(library, download(library))
        for entry in library["files"]:
            data = found[entry["as"]]
            if pin:
                entry["integrity"] = integrity(data)
            elif integrity(data) != entry["integrity"]:
                raise ValueError(f"{entry['as']}: expected {entry['integrity']}, got {integrity(data)}")
            (HERE / entry["as"]).write_bytes(data)
    if pin:
        MANIFEST.write_text(json.dumps(libraries, indent=2) + "\n", encoding="utf-8")


def main() -> int:
    """Exit status 0 done, 1 a file differs or nothing could be fetched."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--check", action="store_true", help="only compare what is here with the manifest, offline")
    parser.add_argument("--pin", action="store_true", help="write the hashes of the fetched files into the manifest")
    arguments = parser.parse_args()
    try:
        if not arguments.check:
            fetch(pin=arguments.pin)
        complaints = faults()
    except (OSError, ValueError, KeyError) as error:
        complaints = [str(error)]
    for complaint in complaints:
        print(complaint, file=sys.stderr)  # noqa: T201 - a script
    return 1 if complaints else 0


if __name__ == "__main__":
    sys.exit(main())
