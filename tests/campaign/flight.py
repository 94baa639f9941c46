"""Flight of one plan, and its outcome."""

from __future__ import annotations

import signal
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import Any
from unittest import mock

from companion.flight import app
from tests.campaign.plan import Plan
from tests.campaign.sortie import Sortie
from tests.campaign.witness import COMPANION

CPU_LIMIT_S = 120.0


class HungError(Exception):
    """A flight that takes so much of the computer hangs."""


def fly(plan: Plan, folder: Path) -> dict[str, Any]:
    """Fly a plan; the result can be written as JSON."""
    started_s = time.process_time()
    sortie = Sortie(plan, folder)
    error = ""
    try:
        with (
            _limited(CPU_LIMIT_S),
            mock.patch.object(app, "gc"),
        ):  # a full collection costs as much as 5 s of flight
            sortie.fly(sortie.script)
    except Exception as failure:
        error = f"{type(failure).__name__}: {failure}"[:300]
    if sortie.record is not None:
        sortie.record.unlink(missing_ok=True)
    return _result(sortie, error) | {"cpu_s": round(time.process_time() - started_s, 2)}


def _result(sortie: Sortie, error: str) -> dict[str, Any]:
    plan, witness, tally = sortie.plan, sortie.witness, sortie.companion.executive.tally
    touchdown, collision = sortie.sim.touchdown, sortie.sim.vehicle.collision
    landed = touchdown is not None and sortie.down
    touchdown_fault = sortie.touchdown_fault() if touchdown is not None else ""
    return {
        **asdict(plan),
        "state": plan.state.value,
        "began_s": witness.began_s,
        "ended_s": witness.ended_s,
        "simulated_s": round(witness.now_s, 1),
        "landed": landed,
        "safe": not touchdown_fault if touchdown is not None else None,
        "touchdown_fault": touchdown_fault,
        "touchdown": touchdown,
        "collision": collision,
        "taken_by": witness.taken_by,
        "taken_s": witness.taken_s,
        "over_s": witness.over_s,
        "landed_by": witness.landed_by,
        "chosen": _chosen(sortie),
        "aborts": tally.abort_reasons,
        "hands_off": tally.hands_off,
        "restarts": sortie.restarts,
        "phase": sortie.phase.value,
        "mode": sortie.sim.autopilot.mode_name,
        "commands_while_pilot_flies": witness.commands_while_pilot_flies,
        "calls": [text for component, text in sortie.calls if component == COMPANION],
        "heard": sortie.heard[witness.heard_before :] if witness.began_s is not None else sortie.heard,
        "error": error,
        "path": [
            [round(v, 2) if isinstance(v, float) else v for v in asdict(s).values()] for s in witness.sights
        ],
    }


def _chosen(sortie: Sortie) -> list[float] | None:
    chosen, frame = sortie.companion.executive.tally.chosen_enu_m, sortie.companion.sensing.history.frame
    if chosen is None or frame is None:
        return None
    return [round(float(v), 2) for v in sortie.sim.autopilot.enu_m(*frame.lla(chosen))]


@contextmanager
def _limited(cpu_s: float) -> Iterator[None]:
    """Raise `HungError` after so much processor time; a process that is only stopped has all the time."""

    def hung(*_: object) -> None:
        raise HungError(f"more than {cpu_s:g} s of processor time")

    before = signal.signal(signal.SIGPROF, hung)
    signal.setitimer(signal.ITIMER_PROF, cpu_s)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.signal(signal.SIGPROF, before)
