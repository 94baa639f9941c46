"""Recorded sensors: poses and returns of a recording, decoded as in flight, on the companion's clock."""

from __future__ import annotations

import struct

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.desk.replay.recording_reader import Header, Raw
from companion.flight.fusion.external_odometry.external_odometry import ExternalOdometry
from companion.flight.fusion.external_odometry.odometry_input import OdometryInput
from companion.flight.fusion.external_odometry.odometry_topic import parse_odometry_topic
from companion.flight.fusion.odometry.place_source import PlaceSource, open_odometry
from companion.flight.fusion.pose_history import CAPACITY, PoseHistory
from companion.flight.link.command_server import CommandServer
from companion.flight.link.inbox import Inbox
from companion.flight.link.position_fix import PATIENCE_NS, PositionGate
from companion.flight.link.vehicle_identity import LISTEN_NS, VehicleIdentity
from companion.flight.link.vehicle_state import VehicleState
from companion.flight.link.wire.codec import Codec
from companion.flight.mapping.window_event import WindowEvent
from companion.flight.recorder import journal
from companion.flight.recorder.journal import BadRecordError
from companion.flight.sensors.diagnosis.lidar_diagnosis import LidarDiagnosis
from companion.flight.sensors.imu_samples import ImuSamples
from companion.flight.sensors.lidar_url import stream_for
from companion.flight.sensors.mavlink_ranges import MavlinkRanges
from companion.flight.sensors.packet_stream import OnReturns, PacketStream
from companion.runtime.event import Event
from params import Parameters
from slz import LocalFrame

ORDERS = ("COMMAND_LONG", "COMMAND_INT")


class RecordedSensors:
    """Decoders and clocks of a flight, fed with recorded messages.

    Parameters
    ----------
    on_returns
        Called with every batch, as in the driver.
    capacity
        Number of poses kept.

    Attributes
    ----------
    history
        The vehicle's poses.
    odometry
        Odometry of the scans, or the external one of the flight; None where the parameters have it off.
    on_imu
        Event of the LiDAR's inertial samples, as in the driver.
    """

    def __init__(
        self, header: Header, parameters: Parameters, on_returns: OnReturns, capacity: int = CAPACITY
    ) -> None:
        self._reader = mavlink.MAVLink(None)
        identity = VehicleIdentity(header.system, LISTEN_NS, header.remembered)
        gate = PositionGate(PATIENCE_NS if header.gated else None)
        self._inbox = Inbox(Codec(parameters.component_id), CommandServer(), identity, gate)
        self._stream = self._ranges = None
        if header.lidar == "mavlink":
            self._ranges = MavlinkRanges(parameters, self._inbox.clock, on_returns)
        else:
            sensor, wall_ns = (header.lidar, header.lidar_metadata), header.clock_offset_ns
            self._stream = stream_for(*sensor, parameters, on_returns, wall_ns)
        self.on_imu: Event[[ImuSamples]] = Event() if self._stream is None else self._stream.on_imu
        self.history = PoseHistory(parameters, capacity=capacity)
        self._inbox.on_certain.subscribe(self.history.limit_to_certain)
        self._inbox.on_attitude.subscribe(self.history.add_attitude)
        self._inbox.on_position.subscribe(self.history.add_position)
        self._inbox.on_reboot.subscribe(self.history.clear)
        self._told = _external(header, parameters, self)
        self.odometry: PlaceSource | None = None if self._told is None else self._told.odometry
        own = None
        if self._told is None:
            own = open_odometry(parameters, self.history, lambda: self.vehicle.health.fix_lost)
        if own is not None:
            self.odometry = own
            self.on_imu.subscribe(own.gyro.add_samples)
            self._inbox.on_attitude.subscribe(own.gyro.add_attitude)

    @property
    def diagnosis(self) -> LidarDiagnosis | None:
        """Diagnosis of the LiDAR's stream and clock; None for a sensor that is not diagnosed."""
        stream = self._stream
        return stream.diagnosis if isinstance(stream, PacketStream) and stream.is_diagnosed else None

    def cloud_offset_ns(self, stamp_ns: int) -> int | None:
        """Return the offset of the stamps of a ROS driver's clouds, None for other sensors."""
        stream = self._stream
        if not isinstance(stream, PacketStream) or stream.kind != "ros2":
            return None
        return stream.offset_ns(stamp_ns)

    @property
    def vehicle(self) -> VehicleState:
        """The vehicle's state, from the autopilot's messages up to now."""
        return self._inbox.followed

    def on_message(self, message: Raw) -> WindowEvent | None:
        """Process the next message; return its event if it is a window's, else None.

        Raises
        ------
        BadRecordError
            It cannot be read.
        """
        match message.topic:
            case journal.MAVLINK_IN:
                try:
                    frame = self._reader.decode(bytearray(message.data))
                except (mavlink.MAVError, struct.error, TypeError, ValueError, IndexError) as error:
                    raise BadRecordError(f"a MAVLink frame cannot be read: {error}") from None
                if frame.get_type() in ORDERS:  # the windows' events hold the operator's orders
                    return None
                if self._inbox.on_message(frame, message.at_ns) and self._ranges is not None:
                    self._ranges.on_message(frame, message.at_ns)
            case journal.LIDAR if self._stream is not None:
                for arrival_ns, packet in journal.unpack_batch(message.data):
                    self._stream.add_packet(packet, "", arrival_ns)
                self._stream.flush(message.at_ns)
            case journal.ODOMETRY if self._told is not None:
                for arrival_ns, packet in journal.unpack_batch(message.data):
                    self._told.stream.add_packet(packet, arrival_ns)
            case journal.EVENT:
                event = journal.unpack_event(message.data)
                if isinstance(event, LocalFrame):
                    self.history.begin_frame(event)
                    return None
                if isinstance(event, WindowEvent):
                    return event
                self._inbox.clock.timesync.request(event)
        return None


def _external(header: Header, parameters: Parameters, sensors: RecordedSensors) -> OdometryInput | None:
    """Return the external odometry of the flight, None without one or where the parameters use none."""
    if not header.odometry or parameters.odometry == "off":
        return None
    topic, history = parse_odometry_topic(header.odometry), sensors.history
    odometry = ExternalOdometry(
        history, topic.child_frame(parameters), lambda: sensors.vehicle.health.fix_lost
    )
    return OdometryInput.open(topic, odometry, sensors.cloud_offset_ns, lambda: header.clock_offset_ns)
