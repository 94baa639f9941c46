"""`python -m tests.unit.slz.kept`: keep the numbers as they are now."""

from __future__ import annotations

import json

from tests.unit.slz.kept.fingerprint import fingerprint
from tests.unit.slz.kept.flights import KEPT
from tests.unit.slz.kept.test_kept import FILE

if __name__ == "__main__":
    numbers = {name: [fingerprint(thing) for thing in made()] for name, made in KEPT.items()}
    lines = json.dumps(numbers).replace('], "', '],\n"')
    FILE.write_text(lines + "\n")
    print(FILE, FILE.stat().st_size, "bytes")
