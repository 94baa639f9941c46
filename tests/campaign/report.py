"""The campaign's report: a table of faults and states, times, and each failure with its picture."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from tests.campaign import picture, reactions
from tests.campaign.log import Flown
from tests.campaign.plan import FAULTS, STATES
from tests.campaign.witness import FAILSAFE, PILOT

MOST_PICTURES = 40


def write(flights: Sequence[Flown], folder: Path) -> int:
    """Write report.md and the pictures; return how many flights failed."""
    wrong = {f["number"]: found for f in flights if (found := reactions.faults_of(f))}
    lines = ["# Fault campaign", "", *_summary(flights, wrong), "", *_matrix(flights, wrong), ""]
    failed = sorted(
        (f for f in flights if f["number"] in wrong), key=lambda f: (not reactions.unsafe(f), f["number"])
    )
    for count, flight in enumerate(failed):
        lines += _failure(flight, wrong[flight["number"]], folder, drawn=count < MOST_PICTURES)
    (folder / "report.md").write_text("\n".join(lines) + "\n", "utf-8")
    return len(wrong)


def _summary(flights: Sequence[Flown], wrong: dict[int, list[str]]) -> list[str]:
    ends = Counter(_end(f) for f in flights)
    cpu = [f["cpu_s"] for f in flights] or [0.0]
    unsafe = sum(bool(reactions.unsafe(f)) for f in flights)
    against = sum(f["commands_while_pilot_flies"] for f in flights)
    reached = sum(f["began_s"] is not None for f in flights)
    return [
        f"{len(flights)} flights, {reached} with the fault begun in its state; **{unsafe} unsafe touchdowns "
        f"or collisions**, {len(wrong)} flights not as stated.",
        "",
        f"Ends: {', '.join(f'{count} {end}' for end, count in ends.most_common())}. "
        f"Aborts: {sum(len(f['aborts']) for f in flights)}. "
        f"Commands while the pilot or a failsafe flies: {against}. "
        f"{_of_others(flights)}. "
        f"Processor time a flight: median {np.median(cpu):.1f} s, greatest {max(cpu):.1f} s.",
    ]


def _of_others(flights: Sequence[Flown]) -> str:
    """Return how many came down by the autopilot's failsafe and by the pilot, and how many of these badly."""
    texts = []
    for who, name in ((FAILSAFE, "the autopilot's failsafe"), (PILOT, "the pilot's stick")):
        ended = [f for f in flights if f["landed_by"] == who]
        bad = sum(bool(reactions.bad_end(f)) for f in ended)
        texts.append(f"by {name} {len(ended)} ({bad} on unsafe ground or into something)")
    return f"Landed not by the companion: {', '.join(texts)}"


def _end(flight: Flown) -> str:
    if flight["landed_by"] == FAILSAFE:
        return "landed by the autopilot's failsafe"
    if flight["landed_by"] == PILOT:
        return "landed by the pilot's stick"
    if flight["collision"] is not None:
        return "collided"
    if flight["landed"]:
        return "landed on safe ground" if flight["safe"] else "landed on unsafe ground"
    if flight["phase"] == "hold":
        return "hover, pilot called"
    if flight["taken_by"] == FAILSAFE:
        return "left to the autopilot's failsafe"
    return "left to the pilot" if flight["hands_off"] else f"flying ({flight['phase']})"


def _matrix(flights: Sequence[Flown], wrong: dict[int, list[str]]) -> list[str]:
    cells: defaultdict[tuple[str, str], list[Flown]] = defaultdict(list)
    for flight in flights:
        cells[flight["fault"], flight["state"]].append(flight)
    names = [state.value for state in STATES]
    lines = [
        "Landed of flown; !n: n not as stated.",
        "",
        f"| fault | {' | '.join(names)} |",
        f"|---|{'---|' * len(names)}",
    ]
    for fault in FAULTS:
        texts = [_cell(cells[fault, name], wrong) for name in names]
        if any(texts):
            lines.append(f"| {fault} | {' | '.join(texts)} |")
    return lines


def _cell(flights: Sequence[Flown], wrong: dict[int, list[str]]) -> str:
    if not flights:
        return ""
    failed = sum(f["number"] in wrong for f in flights)
    return f"{sum(f['landed'] for f in flights)}/{len(flights)}" + (f" **!{failed}**" if failed else "")


def _failure(flight: Flown, wrong: list[str], folder: Path, *, drawn: bool) -> list[str]:
    number = flight["number"]
    lines = [
        f"## {number}: {flight['fault']} in {flight['state']}",
        "",
        f"{'; '.join(wrong)}. Scene {flight['scene']}; aborts {flight['aborts']}; heard {flight['heard']}.",
        "",
        f"Again: `python -m tests.campaign --first {number} --flights 1 --out out/again`",
        "",
    ]
    if drawn and len(flight["path"]) > 1:
        (folder / "failures").mkdir(exist_ok=True)
        picture.draw(flight, wrong, folder / "failures" / f"{number}.png")
        lines += [f"![plan](failures/{number}.png)", ""]
    return lines
