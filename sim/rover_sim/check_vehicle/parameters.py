"""The parameter protocol. The checks set a parameter only to its present value."""

from collections.abc import Set
from struct import pack, unpack
from typing import Any

from rover_sim.check_vehicle.context import Context
from rover_sim.check_vehicle.probe import AUTOPILOT, Heard

PARAM_VALUE, REAL32, UINT32 = 22, 9, 5
LIST_LIMIT = 60.0  # s for the whole list
QUIET = 1.5  # s without a new one end the list
ROUNDS = 3  # of reading missing ones by index
ANSWER_LIMIT = 1.0  # s
DIGEST = "_HASH_CHECK"
UNNUMBERED = 65535


def check_parameters(context: Context) -> None:
    """Read the list, then single parameters; set one to its present value."""
    values = _read_list(context)
    if not values:
        return
    _check_single_reads(context, values)
    _check_set(context, values)
    _check_encoding(context, values)
    _check_digest(context)
    _check_needed(context, set(values))


def _read_list(context: Context) -> dict[str, Any]:
    probe, report = context.probe, context.report
    mark = probe.mark()
    probe.send(probe.messages.param_request_list_encode(probe.system_id, AUTOPILOT))
    began = last = probe.now
    heard: list[Any] = []
    while probe.now - last < QUIET and probe.now - began < LIST_LIMIT:
        probe.pump()
        found = _listed(probe.since(mark, PARAM_VALUE))
        if len(found) > len(heard):
            last = probe.now
        heard = found
        if heard and len(heard) >= heard[0].param_count:
            break
    probe.listen(0.3)  # a surplus one would come now
    heard = _listed(probe.since(mark, PARAM_VALUE))
    if not report.expect(
        "list",
        bool(heard),
        expected="PARAM_VALUEs after PARAM_REQUEST_LIST (without one a QGroundControl waits)",
        seen=f"{len(heard)} in {probe.now - began:.1f} s",
    ):
        return {}
    counts = {each.param_count for each in heard}
    report.expect(
        "count",
        len(counts) == 1,
        expected="the same param_count in each",
        seen=", ".join(str(count) for count in sorted(counts)),
    )
    _check_indices(context, heard, max(counts))
    return {each.param_id: each for each in heard}


def _listed(heard: list[Heard]) -> list[Any]:
    """Return the messages of the list; one without an index has another cause.

    ArduPilot sends parameters that it changes itself this way (4.6.3), PX4 its _HASH_CHECK (1.17).
    """
    return [each.message for each in heard if each.message.param_index != UNNUMBERED]


def _check_indices(context: Context, heard: list[Any], count: int) -> None:
    report = context.report
    by_index = {each.param_index: each.param_id for each in heard}
    for _ in range(ROUNDS):
        for index in set(range(count)) - set(by_index):
            found = _read(context, "", index)
            if found is not None:
                by_index[found.param_index] = found.param_id
    missing, beyond = set(range(count)) - set(by_index), set(by_index) - set(range(count))
    report.expect(
        "indices",
        not missing and not beyond,
        expected=f"each index from 0 to {count - 1}",
        seen=f"{len(by_index)} indices"
        + (f", missing {_some(missing)}" if missing else "")
        + (f", beyond {_some(beyond)}" if beyond else ""),
    )
    names = list(by_index.values())
    twice = {name for name in names if names.count(name) > 1}
    report.expect(
        "names",
        not twice,
        expected="no name twice",
        seen=f"twice: {_some(twice)}" if twice else f"{len(names)}, each once",
    )


def _check_single_reads(context: Context, values: dict[str, Any]) -> None:
    name, listed = next(iter(values.items()))
    by_name, by_index = _read(context, name, -1), _read(context, "", listed.param_index)
    context.report.expect(
        "read by name",
        by_name is not None and _same(by_name, listed),
        expected=f"{name} as in the list, within 1 s",
        seen="silence" if by_name is None else f"{by_name.param_id} = {by_name.param_value!r}",
    )
    context.report.expect(
        "read by index",
        by_index is not None and by_index.param_id == name and _same(by_index, listed),
        expected=f"{name} for index {listed.param_index}, within 1 s",
        seen="silence" if by_index is None else f"{by_index.param_id} = {by_index.param_value!r}",
    )


def _check_set(context: Context, values: dict[str, Any]) -> None:
    """Set a float only: with a misunderstood encoding, an integer would change its value."""
    probe = context.probe
    listed = next((each for each in values.values() if each.param_type == REAL32), None)
    if listed is None:
        context.report.skip("set is echoed", "there is no parameter of type REAL32")
        return
    mark, name = probe.mark(), listed.param_id
    probe.send(
        probe.messages.param_set_encode(
            probe.system_id, AUTOPILOT, name.encode(), listed.param_value, REAL32
        )
    )
    echo = probe.wait(
        PARAM_VALUE, ANSWER_LIMIT, since=mark, condition=lambda m: bool(m.param_id == name)
    )
    context.report.expect(
        "set is echoed",
        echo is not None and _same(echo, listed),
        expected=f"PARAM_VALUE of {name} within 1 s (it was set to what it is)",
        seen="silence" if echo is None else f"{echo.param_value!r}",
    )


def _check_encoding(context: Context, values: dict[str, Any]) -> None:
    probe, report, way = context.probe, context.report, context.way
    how = "bytewise" if way.bytewise else "as a float"
    name = next((each for each in way.system_id_parameters if each in values), None)
    if name is None:
        report.skip("encoding", f"no {' or '.join(way.system_id_parameters)} to judge it by")
        return
    value = values[name].param_value
    if way.bytewise and values[name].param_type != REAL32:
        (value,) = unpack("<i", pack("<f", value))
    report.expect(
        "encoding",
        value == probe.system_id,
        expected=f"{name} = {probe.system_id}, an integer {how}",
        seen=f"{value!r}, read {how}",
    )


def _check_digest(context: Context) -> None:
    if not context.way.has_digest:
        return
    found = _read(context, DIGEST, -1)
    context.report.expect(
        DIGEST,
        found is not None and found.param_type == UINT32,
        expected="a UINT32 within 1 s (QGroundControl waits for it before it reads the list)",
        seen="silence" if found is None else f"type {found.param_type}",
    )


def _check_needed(context: Context, names: set[str]) -> None:
    report, way = context.report, context.way
    missing = way.at_connect - names
    report.expect(
        "parameters for QGroundControl",
        not missing,
        expected="all without which QGroundControl asks for setup when it connects",
        seen=f"missing: {_some(missing)}" if missing else "all there",
    )
    if missing := way.in_setup - names:
        said = f"missing {_some(missing)}: QGroundControl may say so when Vehicle Setup is opened"
        report.note("parameters for Vehicle Setup", said)


def _read(context: Context, name: str, index: int) -> Any:
    probe = context.probe
    mark = probe.mark()
    probe.send(
        probe.messages.param_request_read_encode(probe.system_id, AUTOPILOT, name.encode(), index)
    )

    def is_it(message: Any) -> bool:
        return bool(message.param_id == name if index < 0 else message.param_index == index)

    return probe.wait(PARAM_VALUE, ANSWER_LIMIT, since=mark, condition=is_it)


def _same(one: Any, other: Any) -> bool:
    return pack("<f", one.param_value) == pack("<f", other.param_value)


def _some(items: Set[Any]) -> str:
    shown = [str(each) for each in sorted(items)]
    return ", ".join(shown[:12]) + (f" and {len(shown) - 12} more" if len(shown) > 12 else "")
