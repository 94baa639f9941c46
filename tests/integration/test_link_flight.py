"""The link against an autopilot over UDP: found, followed, commanded, lost and found again."""

from __future__ import annotations

import asyncio
import socket
from contextlib import asynccontextmanager
from types import SimpleNamespace
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.flight.doctor.autopilot_fitness import Fitness
from companion.flight.link.autopilots.ardupilot import ARDUPILOT
from companion.flight.link.command_server import CommandReply, OperatorCommand
from companion.flight.link.link import Link
from companion.flight.link.message_rates import wanted
from companion.flight.link.vehicle_identity import VehicleIdentity
from companion.flight.link.wire.key_mismatch import KeyMismatch
from companion.flight.link.wire.signing import Signing
from companion.runtime.clock import now_ns
from companion.runtime.errors import UsageError
from params import Parameters
from tests.integration.link_bench import (
    GUIDED,
    LAND,
    Autopilot,
    autopilot_over_udp,
    running,
    until,
    virtually,
)
from tests.ports import free_port

USER, DO_SET_MODE = mavlink.MAV_CMD_USER_1, mavlink.MAV_CMD_DO_SET_MODE
MS = 1_000_000
ALL_STREAMS = len(wanted(ARDUPILOT, 50.0))


def test_the_vehicle_is_found_and_its_pose_flows_at_the_rate_asked_for() -> None:
    async def flight() -> None:
        port = free_port()
        async with running(f"udpin:127.0.0.1:{port}") as link, autopilot_over_udp(port, system=7):
            await until(lambda: link.connected)
            await asyncio.sleep(10)
            statistics = link.statistics()
            vehicle = link.vehicle
            assert (vehicle.sysid, vehicle.autopilot, vehicle.mode) == (7, ARDUPILOT, "LOITER")
            assert statistics.rates_hz["ATTITUDE_QUATERNION"] == pytest.approx(50, abs=3)
            assert statistics.rates_hz["GLOBAL_POSITION_INT"] == pytest.approx(50, abs=3)
            assert vehicle.landed == "in_air"
            assert statistics.lost == statistics.bad == statistics.bad_bytes == 0
            assert statistics.missing == ("HOME_POSITION", "GPS_RAW_INT", "SYS_STATUS", "BATTERY_STATUS")

    virtually(flight)


def test_a_vehicle_that_signs_without_a_key_here_is_not_commanded_and_asked_for_nothing() -> None:
    async def flight() -> None:
        port, fitness = free_port(), Fitness(auto=True)
        async with (
            running(f"udpin:127.0.0.1:{port}") as link,
            autopilot_over_udp(port, key=b"k" * 32) as autopilot,
        ):
            texts: list[str] = []
            link.on_text.subscribe(lambda text, _: texts.append(text))
            watch = asyncio.create_task(fitness.run(link, lambda: False))
            await until(lambda: link.connected)
            assert link.no_command_reason == ""
            await asyncio.sleep(30)
            assert link.key_mismatch is KeyMismatch.NO_KEY
            assert link.no_command_reason == "vehicle signs, no --mavlink-key"
            assert link.statistics().key_mismatch == link.no_command_reason
            assert (fitness.fit, fitness.faults, texts) == (False, (), [])
            autopilot.stop_signing()
            await asyncio.sleep(30)
            assert link.key_mismatch is None
            assert link.no_command_reason == ""
            assert len(fitness.faults) > 0
            watch.cancel()

    virtually(flight)


def test_a_vehicle_that_signs_and_still_hears_us_may_be_commanded() -> None:
    """ArduPilot accepts unsigned frames on its first port, and signs there."""

    async def flight() -> None:
        port = free_port()
        async with (
            running(f"udpin:127.0.0.1:{port}") as link,
            autopilot_over_udp(port, key=b"k" * 32, hears_unsigned=True),
        ):
            await asyncio.sleep(60)
            assert link.connected
            assert link.key_mismatch is None

    virtually(flight)


@pytest.mark.parametrize(
    ("key", "told"),
    [(None, "vehicle does not sign, we do"), (b"o" * 32, "vehicle signs with another key")],
)
def test_a_vehicle_whose_frames_we_refuse_is_told_once(key: bytes | None, told: str) -> None:
    async def flight() -> None:
        port = free_port()
        async with running(f"udpin:127.0.0.1:{port}", Signing(b"k" * 32)) as link:
            texts: list[str] = []
            link.on_text.subscribe(lambda text, _: texts.append(text))
            async with autopilot_over_udp(port, key=key):
                await asyncio.sleep(30)
            assert not link.connected
            assert texts == [f"SLZ: {told}"]

    virtually(flight)


def test_our_heartbeat_comes_every_second_from_the_vehicle_s_system() -> None:
    async def flight() -> None:
        port = free_port()
        async with (
            running(f"udpin:127.0.0.1:{port}") as link,
            autopilot_over_udp(port, system=7) as autopilot,
        ):
            await until(lambda: link.connected)
            link.ready = True
            autopilot.received.clear()
            await asyncio.sleep(10.05)
            beats = autopilot.heard("HEARTBEAT")
            assert len(beats) in (10, 11)
            last = beats[-1]
            assert (last.type, last.autopilot, last.system_status) == (18, 8, mavlink.MAV_STATE_ACTIVE)
            assert (last.get_srcSystem(), last.get_srcComponent()) == (7, 191)

    virtually(flight)


def test_poses_are_stamped_in_our_clock_whatever_their_way_took() -> None:
    async def flight() -> None:
        port = free_port()
        errors: list[float] = []
        async with running(f"udpin:127.0.0.1:{port}") as link, autopilot_over_udp(port) as autopilot:
            await until(lambda: link.inbox.clock.timesync.synced)
            sent: dict[int, int] = {}
            link.subscribe("ATTITUDE_QUATERNION", lambda m, _: sent.update(last=m.time_boot_ms))
            link.inbox.on_attitude.subscribe(lambda stamp, quat, rates: errors.append(stamp))
            autopilot.delay_s = 0.3
            await asyncio.sleep(1)
            errors.clear()
            await asyncio.sleep(1)
            assert link.statistics().time_source == "timesync"
            true_ns = autopilot.booted_ns + sent["last"] * MS
            assert errors[-1] == pytest.approx(true_ns, abs=3 * MS)
            assert now_ns() - errors[-1] > 290 * MS

    virtually(flight)


def test_positions_come_as_degrees_metres_and_north_east_down() -> None:
    async def flight() -> None:
        port = free_port()
        seen: list[Any] = []
        async with running(f"udpin:127.0.0.1:{port}") as link, autopilot_over_udp(port):
            link.inbox.on_position.subscribe(lambda *position: seen.append(position))
            await until(lambda: seen)
            assert seen[0][1:] == (pytest.approx(47.0), pytest.approx(8.0), 412.0, (1.0, 2.0, -0.5))

    virtually(flight)


def test_silence_is_noticed_after_the_time_out_and_the_streams_are_asked_for_when_it_ends() -> None:
    async def flight() -> None:
        port = free_port()
        changes: list[tuple[bool, int]] = []
        async with (
            running(f"udpin:127.0.0.1:{port}", link_timeout_s=3.0) as link,
            autopilot_over_udp(port) as autopilot,
        ):
            await until(lambda: link.connected)
            await asyncio.sleep(3)
            link.on_connection.subscribe(lambda connected: changes.append((connected, now_ns())))
            autopilot.mute, begun_ns = True, now_ns()
            await until(lambda: changes)
            assert changes[0][0] is False
            assert 2.0e9 <= changes[0][1] - begun_ns <= 3.2e9
            autopilot.mute = False
            autopilot.intervals_s.clear()
            await until(lambda: link.connected)
            await until(lambda: len(autopilot.intervals_s) == ALL_STREAMS, 3)

    virtually(flight)


def test_warnings_that_a_silent_link_swallowed_are_told_with_their_age_when_it_is_back() -> None:
    async def flight() -> None:
        port = free_port()
        async with (
            running(f"udpin:127.0.0.1:{port}", link_timeout_s=3.0) as link,
            autopilot_over_udp(port) as autopilot,
        ):
            await until(lambda: link.connected)
            link.statustext("SLZ: heard", mavlink.MAV_SEVERITY_WARNING)
            await asyncio.sleep(3)
            autopilot.mute = True
            await asyncio.sleep(1.2)
            link.statustext("SLZ: abort: position lost", mavlink.MAV_SEVERITY_WARNING)
            link.statustext("SLZ: choosing again", mavlink.MAV_SEVERITY_INFO)
            await until(lambda: not link.connected)
            autopilot.mute = False
            await until(lambda: link.connected)
            await asyncio.sleep(1)
            late = [m.text for m in autopilot.heard("STATUSTEXT") if " ago: " in m.text]
            assert len(late) == 1
            assert late[0].endswith("s ago: abort: position lost")

    virtually(flight)


def test_after_a_reboot_the_clock_and_the_streams_begin_anew() -> None:
    async def flight() -> None:
        port = free_port()
        async with running(f"udpin:127.0.0.1:{port}") as link, autopilot_over_udp(port) as autopilot:
            await until(lambda: link.inbox.clock.timesync.synced)
            await until(lambda: link.vehicle.position_lla)
            stamps: list[int] = []
            link.inbox.on_attitude.subscribe(lambda stamp, quat, rates: stamps.append(stamp))
            autopilot.reboot()
            # Its default streams tell of the reboot before anything is asked for.
            autopilot.intervals_s[mavlink.MAVLINK_MSG_ID_ATTITUDE_QUATERNION] = 0.25
            await until(lambda: link.vehicle.reboots == 1)
            assert not link.inbox.clock.timesync.synced
            await until(
                lambda: link.inbox.clock.timesync.synced and len(autopilot.intervals_s) == ALL_STREAMS
            )
            await asyncio.sleep(1)
            assert now_ns() - 50 * MS <= stamps[-1] <= now_ns()
            assert stamps == sorted(stamps)

    virtually(flight)


def test_another_vehicle_on_the_wire_is_ignored_even_when_ours_is_lost() -> None:
    async def flight() -> None:
        port = free_port()
        async with running(f"udpin:127.0.0.1:{port}") as link, autopilot_over_udp(port) as autopilot:
            await until(lambda: link.vehicle.position_lla)
            autopilot.intervals_s.clear()
            autopilot.mute = True
            async with autopilot_over_udp(port, system=2, mode=LAND):
                await until(lambda: not link.connected)
                await asyncio.sleep(5)
            assert (link.vehicle.sysid, link.vehicle.mode, link.connected) == (1, "LOITER", False)
            assert link.statistics().foreign >= 10

    virtually(flight)


def test_two_vehicles_at_the_start_end_the_link_by_name_before_anything_is_asked_of_either() -> None:
    async def flight() -> None:
        port = free_port()
        link = Link(f"udpin:127.0.0.1:{port}", Parameters())
        async with autopilot_over_udp(port) as ours, autopilot_over_udp(port, system=2) as other:
            with pytest.raises(
                UsageError, match=r"system 1 \(quadrotor\) and system 2 \(quadrotor\).*--system"
            ):
                await link.run()
            asked = {m.get_type() for pilot in (ours, other) for m in pilot.received}
            assert asked <= {"HEARTBEAT"}

    virtually(flight)


def test_the_vehicle_that_was_named_is_flown_beside_another() -> None:
    async def flight() -> None:
        port = free_port()
        link = Link(f"udpin:127.0.0.1:{port}", Parameters(), identity=VehicleIdentity(2))
        async with autopilot_over_udp(port), autopilot_over_udp(port, system=2, mode=LAND):
            task = asyncio.create_task(link.run())
            await until(lambda: link.connected)
            await asyncio.sleep(5)
            assert (link.vehicle.sysid, link.vehicle.mode, link.system_id) == (2, "LAND", 2)
            await link.close()
            await task

    virtually(flight)


def test_a_vehicle_that_comes_later_is_told_to_the_pilot_once() -> None:
    async def flight() -> None:
        port = free_port()
        async with running(f"udpin:127.0.0.1:{port}") as link, autopilot_over_udp(port):
            await until(lambda: link.connected)
            told: list[str] = []
            link.on_text.subscribe(lambda text, _severity: told.append(text))
            async with autopilot_over_udp(port, system=2):
                await asyncio.sleep(10)
            assert told == ["SLZ: vehicle 2 heard too, ours is 1"]
            assert (link.vehicle.sysid, link.connected) == (1, True)

    virtually(flight)


def test_a_command_is_repeated_until_it_is_heard() -> None:
    async def flight() -> None:
        port = free_port()
        async with running(f"udpin:127.0.0.1:{port}") as link, autopilot_over_udp(port) as autopilot:
            await until(lambda: link.connected)
            autopilot.deaf_to[400] = 2
            result = await link.command(400, 1.0)
            assert (result.ok, result.tries) == (True, 3)
            sent = [m.confirmation for m in autopilot.heard("COMMAND_LONG") if m.command == 400]
            assert sent == [0, 1, 2]
            autopilot.deaf_to[400] = 99
            assert (await link.command(400, 1.0, tries=2)).outcome == "timeout"

    virtually(flight)


def test_a_mode_counts_only_when_the_vehicle_says_that_it_is_in_it() -> None:
    async def flight() -> None:
        port = free_port()
        async with running(f"udpin:127.0.0.1:{port}") as link, autopilot_over_udp(port) as autopilot:
            await until(lambda: link.connected)
            assert (await link.set_mode("GUIDED")).ok
            assert link.vehicle.guided
            autopilot.obeys_modes = False
            assert (await link.set_mode("LAND")).outcome == "unconfirmed"
            assert (await link.set_mode("OFFBOARD")).outcome == "unsupported"

    virtually(flight)


def test_a_newer_mode_takes_the_place_of_one_that_gets_no_answer() -> None:
    async def flight() -> None:
        port = free_port()
        async with running(f"udpin:127.0.0.1:{port}") as link, autopilot_over_udp(port) as autopilot:
            await until(lambda: link.connected)
            autopilot.deaf_to[DO_SET_MODE] = 1
            first = asyncio.create_task(link.set_mode("GUIDED"))
            await asyncio.sleep(0.2)
            second = await link.set_mode("LAND")
            assert (await first).outcome == "superseded"
            assert second.ok
            assert autopilot.mode == LAND

    virtually(flight)


def test_before_a_vehicle_is_known_nothing_can_be_commanded() -> None:
    async def flight() -> None:
        async with running(f"udpin:127.0.0.1:{free_port()}") as link:
            assert (await link.command(400, 1.0)).outcome == "not_connected"
            assert (await link.set_mode("LAND")).outcome == "unsupported"

    virtually(flight)


def test_an_operator_is_obeyed_once_answered_twice_and_told_why_not() -> None:
    async def flight() -> None:
        port = free_port()
        done: list[OperatorCommand] = []
        reason = "no zone is safe enough, climb and look again at the other side"

        def carry_out(command: OperatorCommand) -> CommandReply:
            done.append(command)
            return CommandReply.denied(reason)

        async with running(f"udpin:127.0.0.1:{port}") as link, autopilot_over_udp(port) as autopilot:
            await until(lambda: link.connected)
            link.on_command(carry_out)
            for confirmation in (0, 1):
                order = mavlink.MAVLink_command_long_message(1, 191, USER, confirmation, 1, 0, 0, 0, 0, 0, 0)
                autopilot.send(order, system=255, component=190)
            everybody = mavlink.MAVLink_command_long_message(0, 0, USER, 0, 1, 0, 0, 0, 0, 0, 0)
            autopilot.send(everybody, system=255, component=190)
            await until(lambda: len(autopilot.heard("COMMAND_ACK")) == 2)
            await asyncio.sleep(1)
            assert len(done) == 1
            acks = autopilot.heard("COMMAND_ACK")
            assert [(a.result, a.target_system, a.target_component) for a in acks] == [(2, 255, 190)] * 2
            texts = autopilot.heard("STATUSTEXT")
            assert "".join(t.text for t in texts) == reason
            assert [(t.chunk_seq, t.severity) for t in texts] == [(0, 4), (1, 4)]

    virtually(flight)


def test_the_autopilot_s_own_timesync_is_answered_in_our_clock() -> None:
    async def flight() -> None:
        port = free_port()
        async with running(f"udpin:127.0.0.1:{port}") as link, autopilot_over_udp(port) as autopilot:
            await until(lambda: link.connected)
            autopilot.send(mavlink.MAVLink_timesync_message(0, 4242))
            await until(lambda: any(m.ts1 == 4242 for m in autopilot.heard("TIMESYNC")))
            reply = next(m for m in autopilot.heard("TIMESYNC") if m.ts1 == 4242)
            assert 0 <= now_ns() - reply.tc1 <= 50 * MS

    virtually(flight)


def test_a_subscriber_s_fault_ends_the_link_instead_of_passing_unseen() -> None:
    async def flight() -> None:
        port = free_port()

        def fail(message: Any, at_ns: int) -> None:
            raise ZeroDivisionError("mine")

        async with autopilot_over_udp(port):
            link = Link(f"udpin:127.0.0.1:{port}", Parameters())
            link.subscribe("HEARTBEAT", fail)
            with pytest.raises(ZeroDivisionError, match="mine"):
                await link.run()

    virtually(flight)


def test_of_several_faults_the_first_is_told() -> None:
    async def flight() -> None:
        port, faults = free_port(), [0]

        def fail(message: Any, at_ns: int) -> None:
            faults[0] += 1
            raise ZeroDivisionError(f"number {faults[0]}")

        async with autopilot_over_udp(port) as autopilot:
            link = Link(f"udpin:127.0.0.1:{port}", Parameters())
            link.subscribe("HEARTBEAT", fail)
            running_ = asyncio.create_task(link.run())
            await asyncio.sleep(0.02)
            for _ in range(20):
                autopilot.send(mavlink.MAVLink_heartbeat_message(2, 3, 1, LAND, 4, 3))
            with pytest.raises(ZeroDivisionError, match="number 1$"):
                await running_
            assert faults[0] > 1

    virtually(flight)


def test_a_mode_that_the_vehicle_is_in_already_is_not_waited_for() -> None:
    async def flight() -> None:
        port = free_port()
        async with running(f"udpin:127.0.0.1:{port}") as link, autopilot_over_udp(port, mode=GUIDED):
            await until(lambda: link.vehicle.guided)
            began = asyncio.get_running_loop().time()
            assert (await link.set_mode("GUIDED")).ok
            assert asyncio.get_running_loop().time() - began < 0.1

    virtually(flight)


def test_a_broken_line_holds_nothing_up_until_it_is_there_again() -> None:
    async def flight() -> None:
        port, loop = free_port(socket.SOCK_STREAM), asyncio.get_running_loop()

        @asynccontextmanager
        async def plugged() -> Any:
            with socket.create_server(("127.0.0.1", port)) as server:
                server.setblocking(False)
                client, _ = await loop.sock_accept(server)
            with client:
                client.setblocking(False)
                autopilot = Autopilot(SimpleNamespace(write=client.send))
                loop.add_reader(client, lambda: autopilot.hear(client.recv(4096)))
                flying = asyncio.create_task(autopilot.fly())
                yield autopilot
                flying.cancel()
                loop.remove_reader(client)

        async with running(f"tcp:127.0.0.1:{port}") as link:
            for _ in range(2):
                async with plugged():
                    await until(lambda: link.connected and link.statistics().rates_hz)
                    await asyncio.sleep(5)
                await asyncio.sleep(4)  # longer than streams may be away, shorter than the autopilot may
                assert link.connected
                await asyncio.sleep(6)
                assert not link.connected

    virtually(flight)


def test_closing_says_good_bye_and_leaves_no_task() -> None:
    async def flight() -> None:
        port = free_port()
        async with autopilot_over_udp(port) as autopilot:
            before = asyncio.all_tasks()
            async with running(f"udpin:127.0.0.1:{port}") as link:
                await until(lambda: link.connected)
            await asyncio.sleep(0.1)
            assert asyncio.all_tasks() == before
            assert autopilot.heard("HEARTBEAT")[-1].system_status == mavlink.MAV_STATE_POWEROFF
            await link.close()

    virtually(flight)


def test_a_cancelled_link_says_good_bye_too() -> None:
    async def flight() -> None:
        port = free_port()
        async with autopilot_over_udp(port) as autopilot:
            link = Link(f"udpin:127.0.0.1:{port}", Parameters())
            task = asyncio.create_task(link.run())
            await until(lambda: link.connected)
            task.cancel()
            await asyncio.gather(task, return_exceptions=True)
            await asyncio.sleep(0.1)
            assert task.cancelled()
            assert autopilot.heard("HEARTBEAT")[-1].system_status == mavlink.MAV_STATE_POWEROFF
            assert not link.connected

    virtually(flight)


def test_a_subscription_ends_when_asked_to() -> None:
    async def flight() -> None:
        port = free_port()
        async with running(f"udpin:127.0.0.1:{port}") as link, autopilot_over_udp(port, mode=GUIDED):
            beats: list[Any] = []
            unsubscribe = link.subscribe("HEARTBEAT", lambda message, at_ns: beats.append(message))
            await until(lambda: len(beats) == 2)
            unsubscribe()
            unsubscribe()
            await asyncio.sleep(3)
            assert len(beats) == 2

    virtually(flight)
