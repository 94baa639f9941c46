"""MAVSDK, pymavlink and MAVProxy fetch the metadata of the companion's parameters."""

from __future__ import annotations

import asyncio
import json
import lzma
from pathlib import Path
from typing import Any

import pytest
from mavsdk.asyncio import ComponentType, Configuration, Mavsdk
from mavsdk.asyncio.plugins.component_metadata import ComponentMetadataAsync, MetadataType
from pymavlink import mavutil
from pymavlink.mavftp import MAVFTP

import params
from tests.integration.mavproxy import Station
from tests.integration.service_bench import STEP_S, ship, until

pytestmark = pytest.mark.realtime

NAMES = [row.mavlink for row in params.rows()]


async def test_mavsdk_shows_names_units_ranges_and_help(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))  # its cache of metadata
    async with ship(tmp_path / "state") as flown:
        configuration = Configuration.create_with_component_type(ComponentType.GROUND_STATION)
        async with Mavsdk(configuration) as station:
            # Not through the simulator: like ArduPilot it forwards no message that its dialect lacks.
            await station.add_any_connection(f"udpout://127.0.0.1:{flown.link_port}")
            async with asyncio.timeout(STEP_S):
                while not (systems := await station.get_systems()):
                    await asyncio.sleep(0.1)
            metadata = ComponentMetadataAsync(systems[0])
            updates = metadata.subscribe_metadata_available()
            waiting = asyncio.ensure_future(anext(updates))
            await metadata.request_component(191)
            async with asyncio.timeout(STEP_S):
                update = await waiting
            await updates.aclose()
    assert (update.compid, update.type) == (191, MetadataType.PARAMETER)
    described = {each["name"]: each for each in json.loads(update.json_metadata)["parameters"]}
    assert list(described) == NAMES
    final = described["SLZ_FINAL_H"]
    assert (final["shortDesc"], final["units"], final["min"], final["max"]) == ("Final height", "m", 1, 200)
    assert flown.services.files.refused == 0


def _fetch(port: int) -> tuple[list[str], bytes, int]:
    """Use pymavlink's client: list the folder, get a file, and try to remove it."""
    wire: Any = mavutil.mavlink_connection(f"tcp:127.0.0.1:{port}", source_system=254)
    try:
        wire.wait_heartbeat(timeout=STEP_S)
        ftp = MAVFTP(wire, target_system=1, target_component=191)
        listed = ftp.cmd_list(["/"]).directory_listing
        content = bytearray()
        ftp.cmd_get(["/parameter.json.xz"], callback=lambda file: content.extend(file.read()))
        assert ftp.process_ftp_reply("OpenFileRO", timeout=STEP_S).error_code == 0
        return [e.name for e in listed], bytes(content), ftp.cmd_rm(["/parameter.json.xz"]).error_code
    finally:
        wire.close()


async def test_pymavlink_lists_and_reads_the_files_and_removes_none(tmp_path: Path) -> None:
    async with ship(tmp_path) as flown:
        listed, content, removed = await asyncio.to_thread(_fetch, flown.station_port)
    assert listed == ["general.json.xz", "parameter.json.xz"]
    assert [each["name"] for each in json.loads(lzma.decompress(content))["parameters"]] == NAMES
    assert removed == 9  # protected


async def test_mavproxy_gets_the_files(tmp_path: Path, mavproxy: Path) -> None:
    async with ship(tmp_path) as flown, Station.at(mavproxy, flown.station_port, tmp_path) as station:
        await station.hears("Detected vehicle")
        await station.says("module load ftp")
        await station.says("set target_component 191")
        await station.says("ftp list /")
        await station.hears("parameter.json.xz")
        got = tmp_path / "got.json.xz"
        await station.says(f"ftp get /general.json.xz {got}")
        await until(lambda: got.exists() and got.stat().st_size > 0)
    (only,) = json.loads(lzma.decompress(got.read_bytes()))["metadataTypes"]
    assert only["uri"].endswith("/parameter.json.xz")
