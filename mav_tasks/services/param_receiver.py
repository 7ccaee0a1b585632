"""The parameter protocol, the component's side: PARAM_VALUE for whoever asks. Pure.

MAVLink guide, "Parameter Protocol". All parameters are REAL32. What is asked for and is not there
is answered by PARAM_ERROR, which clients that do not know it pass over.
"""

from collections.abc import Mapping

from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.enums import MavParamError, MavParamType

BY_NAME = -1  # param_index of a request
HASH_CHECK = "_HASH_CHECK"  # by which a client with a cache begins: whatever it asks, it wants all


def value_of(values: Mapping[str, float], name: str) -> m.ParamValue:
    """Return the message that tells one of the values, in the order of the mapping."""
    names = list(values)
    return m.ParamValue(
        name.encode(), values[name], MavParamType.REAL32, len(names), names.index(name)
    )


def all_values(values: Mapping[str, float]) -> list[m.ParamValue]:
    return [value_of(values, name) for name in values]


def read(
    values: Mapping[str, float], message: m.ParamRequestRead, *, to: Address
) -> m.ParamValue | m.ParamError:
    """Return the answer to a question for one of them."""
    index, name = message.param_index, message.param_id
    if index != BY_NAME:
        name = list(values)[index] if 0 <= index < len(values) else ""
    if name in values:
        return value_of(values, name)
    return error(message, MavParamError.DOES_NOT_EXIST, to=to)


def error(message: m.ParamRequestRead | m.ParamSet, why: int, *, to: Address) -> m.ParamError:
    """Return the PARAM_ERROR that answers a message; ``why`` is a MAV_PARAM_ERROR."""
    index = message.param_index if isinstance(message, m.ParamRequestRead) else BY_NAME
    return m.ParamError(*to, message.param_id.encode()[:16], index, why)
