"""What the link serves beside the landing: parameters over MAVLink, and the memory of signing."""

from __future__ import annotations

import asyncio
import logging
from pathlib import Path
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.clock import now_ns
from companion.errors import UsageError
from companion.link.key import read_key
from companion.link.link import Link
from companion.link.parameter_server import ParameterServer
from companion.link.signing import Signing
from companion.settings import Settings
from companion.state import StateDir

log = logging.getLogger(__name__)

TICK_S = 0.05
SIGNING_FILE = "signing"


def start_signing(key_file: Path, state: StateDir) -> Signing:
    """Read the key and go on from the timestamp of the last flight.

    Raises
    ------
    UsageError
        The key is refused, or the state directory holds no timestamp but something else.
    """
    key = read_key(key_file)
    text = (state.read(SIGNING_FILE) or "0").strip()
    if not (text.isascii() and text.isdigit() and int(text) < 2**48):
        raise UsageError(f"{state.folder / SIGNING_FILE}: {text[:20]!r} is no timestamp; delete the file")
    log.info("MAVLink is signed: the key is %s", key.form)
    return Signing(key.secret, int(text))


class Services:
    """Serves the parameters to ground stations.

    Parameters
    ----------
    link, settings
        Where they come from, and who keeps the values.
    signing, state
        The signed link's timestamp is remembered there.
    """

    def __init__(
        self, link: Link, settings: Settings, signing: Signing | None = None, state: StateDir | None = None
    ) -> None:
        self._link = link
        self._signing = signing
        self._state = state
        self.parameters = ParameterServer(settings)
        self.parameters.told.subscribe(self._tell)
        for name in ("PARAM_REQUEST_LIST", "PARAM_REQUEST_READ", "PARAM_SET"):
            link.subscribe(name, self._parameter, anyone=True)

    async def run(self) -> None:
        """Send what is due until cancelled."""
        try:
            while True:
                for message in self.parameters.poll(now_ns()):
                    self._link.send(message)
                self._save_timestamp()
                await asyncio.sleep(TICK_S)
        finally:
            self._save_timestamp(last=True)

    def _parameter(self, message: Any, _at_ns: int) -> None:
        self.parameters.bytewise = self._link.vehicle.autopilot == "px4"
        for answer in self.parameters.take(message, self._link.system_id, self._link.component_id):
            self._link.send(answer)

    def _tell(self, text: str, accepted: bool) -> None:
        log.info(text)
        self._link.statustext(text, mavlink.MAV_SEVERITY_INFO if accepted else mavlink.MAV_SEVERITY_WARNING)

    def _save_timestamp(self, *, last: bool = False) -> None:
        if self._signing is None or self._state is None:
            return
        tick = self._signing.tick if last else self._signing.to_save()
        if tick is not None and (fault := self._state.write(SIGNING_FILE, f"{tick}\n", durable=False)):
            log.warning("the timestamp of signing is not kept: %s", fault)
