import json
from math import inf, isfinite, nan
from random import Random
from struct import pack
from typing import Any

import pytest

from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.layout import Layout
from mav_tasks.mavlink.messages import Message
from mav_tasks.mcap_export.message_json import MessageJson


def encoded(message: Message) -> dict[str, Any]:
    return json.loads(  # type: ignore[no-any-return]
        MessageJson(type(message)).encode(message), parse_constant=pytest.fail
    )


def bits(value: Any, on_wire: str) -> Any:
    if not isinstance(value, float):
        return value
    if not isfinite(value):
        return None
    return pack("<f" if on_wire == "float" else "<d", value + 0.0)


@pytest.mark.parametrize("kind", m.ALL.values(), ids=lambda kind: kind.msgname)
def test_all_fields_of_each_message_are_told_to_the_last_bit(kind: type[Message]) -> None:
    layout = Layout(kind)
    message = layout.message(Random(17).randbytes(layout.struct.size))
    values = encoded(message)
    assert list(values) == kind.fieldnames
    for name, on_wire in zip(kind.fieldnames, kind.fieldtypes, strict=True):
        given, told = getattr(message, name), values[name]
        if not isinstance(given, list):
            given, told = [given], [told]
        floats = on_wire in ("float", "double")
        told = [float(each) if floats and each is not None else each for each in told]
        assert [bits(v, on_wire) for v in told] == [bits(v, on_wire) for v in given]


def test_what_json_has_no_number_for_is_null() -> None:
    values = encoded(m.Attitude(1, nan, inf, -inf, 0.1, 0.0, 0.0))
    assert values["roll"] is values["pitch"] is values["yaw"] is None
    assert (values["time_boot_ms"], values["rollspeed"]) == (1, 0.1)


def test_texts_are_quoted() -> None:
    assert encoded(m.Statustext(6, b'a "text"\\\n\xff', 0, 0))["text"] == 'a "text"\\\n�'


def test_a_float_has_no_more_digits_than_it_needs() -> None:
    layout = Layout(m.Attitude)
    message = layout.message(layout.struct.pack(1, 0.1, 0.5, 0, 0, 0, 0))
    assert b'"roll":0.100000001,"pitch":0.5,' in MessageJson(m.Attitude).encode(message)
