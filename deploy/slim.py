"""Delete from a virtual environment what no flight loads: tests of libraries and unused MAVLink dialects.

python3 deploy/slim.py .venv      for images and small disks; `pip install --force-reinstall` brings it back
"""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

DIALECTS = {"__init__.py", "ardupilotmega.py", "common.py", "standard.py", "minimal.py"}
KEPT = {"numpy/_core/tests"}  # numpy.testing imports a module of it
TESTED = ("numpy", "scipy", "numba", "llvmlite", "shapely")


def unused(packages: Path) -> list[Path]:
    """Return the files and folders below site-packages that no flight loads."""
    dialects = packages / "pymavlink" / "dialects"
    found = [dialects / "v09", dialects / "v10"]
    found += [path for path in (dialects / "v20").iterdir() if path.name not in DIALECTS]
    for name in TESTED:
        tests = sorted((packages / name).rglob("tests"))
        found += [path for path in tests if path.relative_to(packages).as_posix() not in KEPT]
    return found


def main() -> int:
    """Delete, and say how many megabytes."""
    if len(sys.argv) != 2 or not (folders := list(Path(sys.argv[1]).glob("lib/python3.*/site-packages"))):
        print("slim.py: name one virtual environment", file=sys.stderr)
        return 2
    freed = 0
    for path in unused(folders[0]):
        if path.is_dir():
            freed += sum(file.stat().st_size for file in path.rglob("*") if file.is_file())
            shutil.rmtree(path)
        elif path.exists():
            freed += path.stat().st_size
            path.unlink()
    print(f"{freed / 1e6:.0f} MB deleted")
    return 0


if __name__ == "__main__":
    sys.exit(main())
