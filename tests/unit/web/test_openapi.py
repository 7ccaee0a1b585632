"""The API's own description, by an independent validator."""

import ast
from pathlib import Path
from typing import Any, cast

from openapi_spec_validator import validate

from mav_tasks.client.aio import Client
from mav_tasks.key_ring.watch import RingWatch
from mav_tasks.web import hub
from mav_tasks.web.application import operations_of
from mav_tasks.web.events import EVENTS
from mav_tasks.web.live import Live
from mav_tasks.web.openapi import document_of
from mav_tasks.web.operation import Operation
from mav_tasks.web.schemas import SCHEMAS
from mav_tasks.web.services import Services
from mav_tasks.web.sessions import Sessions
from mav_tasks.web.users import Users


def operations() -> list[Operation]:
    client, ring = Client(), RingWatch(Path("none"), None)
    users = Users(ring, client, server="x", own_key=None, connect=lambda _key: client)
    live = Live(client, "x", server="udpout:127.0.0.1:1")
    return operations_of(Services(client, live, users, Sessions(users), "x", "y"))


def test_the_document_is_valid_openapi() -> None:
    validate(cast(Any, document_of(operations())))


def test_each_operation_has_a_name_and_a_described_answer_of_its_own() -> None:
    found = operations()
    document = document_of(found)
    names = [part["operationId"] for path in document["paths"].values() for part in path.values()]
    assert len(names) == len(set(names)) == len(found)
    for operation in found:
        assert operation.answer in {*SCHEMAS, "Events", ""}
        assert (operation.status == 204) == (not operation.answer) or operation.status != 204


def test_words_that_let_a_rover_move_carry_the_epoch() -> None:
    for operation in operations():
        if operation.path.endswith(("/resume", "/release")):
            (epoch,) = (field for field in operation.body or () if field.name == "epoch")
            assert epoch.is_required


def test_each_event_of_the_stream_is_documented() -> None:
    """Those that the sources can send are those that the document describes."""
    sent = {hub.SNAPSHOT, hub.VEHICLES, hub.ALIVE.split()[1].decode()}
    for path in Path(hub.__file__).parent.glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call) and getattr(node.func, "attr", "") == "publish":
                kind = node.args[0]
                assert isinstance(kind, ast.Constant), f"{path.name}: {ast.unparse(node)}"
                sent.add(str(kind.value))
    assert {event.name for event in EVENTS} == sent
    events = document_of(operations())["paths"]["/events"]["get"]
    for event in EVENTS:
        start = f"**{event.name}** ({event.schema}, "
        assert start in events["description"]
        about = events["description"].partition(start)[2].partition("\n\n")[0]
        for name in SCHEMAS[event.schema]["properties"]:
            assert f"\n- `{name}`: " in about, (event.name, name)
    assert "- `since`: number; when the first change in it arrived" in events["description"]
