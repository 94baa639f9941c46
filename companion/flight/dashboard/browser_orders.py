"""Schema of the browser's messages: one strictly validated JSON object each."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, ValidationError

MOST_BYTES = 4096

Metres = Annotated[float, Field(ge=-100_000, le=100_000)]


class _Order(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, strict=True)

    id: Annotated[int, Field(ge=0, lt=2**53)]


class SelectZone(_Order):
    """Select the best point of a zone."""

    do: Literal["select_zone"]
    zone: Annotated[int, Field(ge=1, lt=2**31)]


class SelectPoint(_Order):
    """Select a point of the map."""

    do: Literal["select_point"]
    east_m: Metres
    north_m: Metres


class Confirm(_Order):
    """Land at the selected point, which the sender believes to be this one."""

    do: Literal["confirm"]
    east_m: Metres
    north_m: Metres


class Simple(_Order):
    """Order without arguments."""

    do: Literal["abort", "land_best", "land_now"]


class SetParameter(_Order):
    """Set a parameter by its Python name."""

    do: Literal["set"]
    name: Annotated[str, Field(max_length=64)]
    value: float | int | Annotated[str, Field(max_length=64)]


class Record(_Order):
    """Begin or end a recording."""

    do: Literal["record"]
    on: bool


class Replay(_Order):
    """Control a replay: speed as a multiple of real time, 0 to pause; or jump to a second of the flight."""

    do: Literal["replay"]
    speed: Annotated[float, Field(ge=0, le=100)] | None = None
    at_s: Annotated[float, Field(ge=0, le=1e7)] | None = None


class Facts(_Order):
    """Ask for the map's values at a point; allowed to every role."""

    do: Literal["facts"]
    east_m: Metres
    north_m: Metres


Command = SelectZone | SelectPoint | Confirm | Simple | SetParameter | Record | Replay
Message = Command | Facts
_MESSAGE: TypeAdapter[Message] = TypeAdapter(Annotated[Message, Field(discriminator="do")])


class BadMessageError(ValueError):
    """Invalid message; says why in a line."""


def parse(text: str) -> Message:
    """Return the message in a text.

    Raises
    ------
    BadMessageError
        The text is too long, not JSON, or not one of the messages here.
    """
    if len(text) > MOST_BYTES:
        raise BadMessageError(f"a message has {MOST_BYTES} characters at most")
    try:
        return _MESSAGE.validate_json(text)
    except ValidationError as error:
        first = error.errors(include_url=False, include_input=False, include_context=False)[0]
        where = ".".join(str(part) for part in first["loc"][1:])
        raise BadMessageError(f"{where}: {first['msg']}" if where else str(first["msg"])) from None
