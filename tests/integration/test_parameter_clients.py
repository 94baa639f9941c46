"""MAVSDK, pymavlink and MAVProxy, as ground stations, see and set the companion's parameters."""

from __future__ import annotations

import asyncio
import contextlib
from pathlib import Path
from typing import Any

import pytest
from mavsdk.asyncio import ComponentType, Configuration, Mavsdk
from mavsdk.asyncio.plugins.param import ParamAsync, ParamError, ProtocolVersion
from pymavlink import mavutil

import params
from companion.flight.link.wire.signing import Signing
from tests.integration.mavproxy import Station
from tests.integration.service_bench import STEP_S, Ship, ship, until

pytestmark = pytest.mark.realtime


async def test_mavsdk_lists_reads_and_sets_and_is_refused(tmp_path: Path) -> None:
    async with ship(tmp_path) as flown:
        configuration = Configuration.create_with_component_type(ComponentType.GROUND_STATION)
        async with Mavsdk(configuration) as station:
            await station.add_any_connection(f"tcpout://127.0.0.1:{flown.station_port}")
            system = await station.first_autopilot(timeout_s=STEP_S)
            assert system is not None
            param = ParamAsync(system)
            with contextlib.suppress(ParamError):  # says UNKNOWN in 4.1 and does it
                await param.select_component(191, ProtocolVersion.V1)
            listed = await param.get_all_params()
            names = {p.name for p in (*listed.int_params, *listed.float_params)}
            assert names == {row.mavlink for row in params.rows()}
            assert await param.get_param_float("SLZ_FINAL_H") == 12.0
            assert await param.get_param_int("SLZ_HIST_BINS") == 300
            await param.set_param_float("SLZ_FINAL_H", 20.0)
            await param.set_param_int("SLZ_FUSING", 1)
            assert flown.settings.running.final_height_m == 20.0
            assert (flown.settings.stored.fusing, flown.settings.running.fusing) == ("max", "mean")
            with pytest.raises(Exception, match=r"(?i)wrong|range|failed|error|refus"):
                await param.set_param_float("SLZ_FINAL_H", 9999.0)
            assert await param.get_param_float("SLZ_FINAL_H") == 20.0
    stored = flown.state.read("parameters.toml")  # waits for the disk
    assert stored is not None
    assert stored.splitlines()[1:] == ["final_height_m = 20.0", 'fusing = "max"']


def _fetch(port: int, key: bytes | None) -> tuple[dict[str, float], str]:
    """Use pymavlink as a ground station would: list, set, and read the refusal."""
    wire: Any = mavutil.mavlink_connection(f"tcp:127.0.0.1:{port}", source_system=254)
    if key is not None:
        wire.setup_signing(key, sign_outgoing=True)
    try:
        while (beat := wire.recv_match(type="HEARTBEAT", blocking=True, timeout=STEP_S)) is not None:
            if beat.get_srcComponent() == 191:
                break
        assert beat is not None, "the companion was never heard"
        wire.target_system, wire.target_component = 1, 191
        wire.param_fetch_all()
        values: dict[str, float] = {}
        while len(values) < len(params.rows()):
            message = wire.recv_match(type="PARAM_VALUE", blocking=True, timeout=STEP_S)
            assert message is not None, f"only {len(values)} came"
            if message.get_srcComponent() == 191:
                values[message.param_id] = message.param_value
        wire.param_set_send("SLZ_FINAL_H", 1000.0)
        told = wire.recv_match(
            type="STATUSTEXT", condition="STATUSTEXT.text[:5]=='SLZ: '", blocking=True, timeout=STEP_S
        )
        return values, told.text
    finally:
        wire.close()


async def test_pymavlink_lists_and_reads_why_a_value_is_refused(tmp_path: Path) -> None:
    async with ship(tmp_path) as flown:
        values, told = await asyncio.to_thread(_fetch, flown.station_port, None)
        assert set(values) == {row.mavlink for row in params.rows()}
        assert told.startswith("SLZ: SLZ_FINAL_H: must be a number from 1 to 200")
        assert flown.settings.running.final_height_m == 12.0


async def test_with_a_key_only_a_station_that_has_it_is_served(tmp_path: Path) -> None:
    key = bytes(range(32))
    file = tmp_path / "key"
    file.write_bytes(key)
    file.chmod(0o600)
    async with ship(tmp_path, "--mavlink-key", str(file), signing=Signing(key)) as flown:
        values, _ = await asyncio.to_thread(_fetch, flown.station_port, key)
        assert len(values) == len(params.rows())
        statistics = flown.link.statistics()
        assert statistics.unsigned == statistics.forged == statistics.replayed == 0
    assert int((tmp_path / "signing").read_text("ascii")) > 0


async def _mavproxy_sets(flown: Ship, station: Station) -> None:
    await station.hears("Detected vehicle")
    await station.says("set target_component 191")
    await station.says("param fetch")
    await station.hears(f"Received {len(params.rows())} parameters")
    await station.says("param show SLZ_FINAL_H")
    await station.hears("SLZ_FINAL_H      12")
    await station.says("param set SLZ_FINAL_H 20")
    await until(lambda: flown.settings.running.final_height_m == 20)
    await station.says("param set SLZ_HIST_BINS 400")
    await until(lambda: flown.settings.stored.histogram_bins == 400)
    await station.says("param set SLZ_FINAL_H 1000")
    await station.hears("SLZ: SLZ_FINAL_H: must be a number from 1 to 200")
    assert flown.settings.running.final_height_m == 20


async def test_mavproxy_lists_and_sets_and_is_refused(tmp_path: Path, mavproxy: Path) -> None:
    async with ship(tmp_path) as flown, Station.at(mavproxy, flown.station_port, tmp_path) as station:
        await _mavproxy_sets(flown, station)


async def test_mavproxy_with_a_passphrase_is_served_on_a_signed_link(tmp_path: Path, mavproxy: Path) -> None:
    import hashlib

    file = tmp_path / "key"
    file.write_text("correct-horse\n")
    file.chmod(0o600)
    signing = Signing(hashlib.sha256(b"correct-horse").digest())
    async with (
        ship(tmp_path, "--mavlink-key", str(file), signing=signing) as flown,
        Station.at(mavproxy, flown.station_port, tmp_path, "signing key correct-horse") as station,
    ):
        await _mavproxy_sets(flown, station)
        assert flown.link.statistics().forged == 0
