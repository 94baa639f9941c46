"""Update of the golden values to the current ones (`python -m tests.golden`)."""

from __future__ import annotations

import json

from tests.golden.fingerprint import fingerprint
from tests.golden.flights import KEPT
from tests.golden.test_golden import FILE

if __name__ == "__main__":
    numbers = {name: [fingerprint(thing) for thing in made()] for name, made in KEPT.items()}
    lines = json.dumps(numbers).replace('], "', '],\n"')
    FILE.write_text(lines + "\n")
    print(FILE, FILE.stat().st_size, "bytes")
