"""Persistence of the vehicle's system ID."""

from __future__ import annotations

from pathlib import Path

import pytest

from companion.flight.link.link import Link
from companion.flight.link.vehicle_identity import VehicleIdentity
from companion.flight.link.vehicle_state import VehicleState
from companion.flight.services.vehicle_memory import FILE, identity_from, remember_vehicle
from companion.runtime.state_directory import StateDir
from params import Parameters


def test_the_vehicle_that_was_connected_is_remembered(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    state = StateDir(tmp_path)
    assert identity_from(state, None).remembered is None
    link = Link("udpin:127.0.0.1:14550", Parameters(), identity=VehicleIdentity())
    remember_vehicle(link, state)
    monkeypatch.setattr(Link, "vehicle", VehicleState(sysid=42))
    link.on_connection.emit(False)
    assert identity_from(state, None).remembered is None
    link.on_connection.emit(True)
    assert identity_from(state, None).remembered == 42


@pytest.mark.parametrize("text", ["", "0", "256", "-3", "1.5", "\0", "one", "9" * 40])
def test_what_is_no_system_is_forgotten(tmp_path: Path, text: str) -> None:
    (tmp_path / FILE).write_text(text, "utf-8")
    assert identity_from(StateDir(tmp_path), None).remembered is None


def test_without_a_state_directory_nothing_is_remembered() -> None:
    identity = identity_from(None, 5)
    assert (identity.named, identity.remembered) == (5, None)
