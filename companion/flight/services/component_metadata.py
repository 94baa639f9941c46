"""MAVLink component metadata: names, units, ranges and help of the parameters, for any ground station.

A station asks for COMPONENT_METADATA, which names the general file; that names the file of parameters. Both
are JSON, compressed with xz, and served by MAVLink FTP.
"""

from __future__ import annotations

import json
import lzma
from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any

from companion.flight.link.command_server import CommandReply, OperatorCommand
from companion.flight.link.wire.component_metadata_message import (
    COMPONENT_METADATA,
    MAVLink_component_metadata_message,
)
from companion.flight.services.ftp_server import mavlink_crc32
from companion.runtime.clock import now_ns
from params import Row

GENERAL = "/general.json.xz"
PARAMETER = "/parameter.json.xz"
PARAMETER_TYPE = 1  # COMP_METADATA_TYPE_PARAMETER
# The published schemas count further; the ground stations read version 1 alone.
FORMAT = 1
# The dictionaries of the presets take hundreds of megabytes to write, and a small one suffices.
FILTER = {"id": lzma.FILTER_LZMA2, "preset": 6, "dict_size": 1 << 16}
# Endings of the Python names, which the field for the unit repeats.
ENDINGS = {
    "m": "_m",
    "m/s": "_ms",
    "s": "_s",
    "ms": "_ms",
    "deg": "_deg",
    "Hz": "_hz",
    "MiB": "_mb",
    "1/s": "_per_s",
    "%": "_percent",
}


def parameter_document(rows: Iterable[Row], orders: Iterable[Row] = ()) -> dict[str, Any]:
    """Return the metadata of parameters; `orders` are those that are never stored."""
    described = [_described(row) for row in rows]
    described += [_described(row) | {"category": "Orders", "volatile": True} for row in orders]
    return {"version": FORMAT, "parameters": described}


def metadata_files(parameters: Mapping[str, Any], component: int) -> dict[str, bytes]:
    """Return the files to serve by path, for a component with this ID."""
    described = _compressed(parameters)
    general = {
        "version": FORMAT,
        "vendorName": "slz",
        "modelName": "Safe landing zones",
        "metadataTypes": [
            {
                "type": PARAMETER_TYPE,
                "uri": file_uri(PARAMETER, component),
                "fileCrc": mavlink_crc32(described),
            }
        ],
    }
    return {GENERAL: _compressed(general), PARAMETER: described}


def file_uri(path: str, component: int) -> str:
    """Return the MAVLink FTP URI of a file of a component."""
    return f"mftp://[;comp={component}]{path}"


class MetadataRequests:
    """Answers MAV_CMD_REQUEST_MESSAGE for COMPONENT_METADATA.

    Parameters
    ----------
    files
        The files that are served.
    component
        Our component ID.
    """

    def __init__(self, files: Mapping[str, bytes], component: int) -> None:
        self._crc = mavlink_crc32(files[GENERAL])
        self._uri = file_uri(GENERAL, component)

    def answer(self, command: OperatorCommand) -> CommandReply:
        """Return the answer to a command, with the message if it is this one."""
        if command.params[0] != COMPONENT_METADATA:
            return CommandReply.unsupported()
        at_ms = now_ns() // 1_000_000 % 2**32
        message = MAVLink_component_metadata_message(at_ms, self._crc, self._uri)
        return replace(CommandReply.accepted(), always=True, message=message)


def _described(row: Row) -> dict[str, Any]:
    when = "A change takes effect at once." if row.live else "A change takes effect at the next start."
    described: dict[str, Any] = {
        "name": row.mavlink,
        "type": "Float" if row.kind is float else "Int32",
        "shortDesc": _title(row),
        "longDesc": f"{row.sentence} {when} On the command line: {row.name}.",
        "default": _number(row, row.default),
        "group": "Safe landing zones",
        "category": "Standard",
    }
    if row.unit:
        described["units"] = row.unit
    if row.choices:
        values = [(row.choices.index(text), text) for text in row.airworthy_choices]
        described["values"] = [{"value": number, "description": text} for number, text in values]
        described |= {"min": values[0][0], "max": values[-1][0]}
    if row.low is not None:
        described["min"] = row.low
    if row.high is not None:
        described["max"] = row.high
    if row.kind is float:
        finest = max(_decimals(value) for value in (row.default, row.low, row.high))
        described["decimalPlaces"] = min(finest + 1, 7)
    if not row.live:
        described["rebootRequired"] = True
    return described


def _title(row: Row) -> str:
    name = row.name.removesuffix(ENDINGS[row.unit]) if row.unit else row.name
    return name.replace("_", " ").capitalize()


def _number(row: Row, value: Any) -> float:
    return row.choices.index(value) if row.choices else value


def _decimals(value: float | None) -> int:
    """Return the number of digits after the point that a value needs."""
    return 0 if value is None else len(f"{value:.7f}".rstrip("0").partition(".")[2])


def _compressed(document: Mapping[str, Any]) -> bytes:
    text = json.dumps(document, ensure_ascii=True, separators=(",", ":"))
    return lzma.compress(text.encode("ascii"), check=lzma.CHECK_CRC32, filters=[FILTER])
