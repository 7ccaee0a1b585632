"""The package says its version, and where the definitions of its dialect are."""

import re
from xml.etree import ElementTree

import mav_tasks
from mav_tasks.mavlink.definitions import DIALECT, folder_of_definitions
from tests.kit.commands import called


def test_the_version_is_that_of_the_installation() -> None:
    assert re.fullmatch(r"\d+\.\d+\.\d+", mav_tasks.__version__)
    assert called("--version").output == f"mav-tasks {mav_tasks.__version__}\n"


def test_the_definitions_are_there_and_are_printed() -> None:
    folder = folder_of_definitions()
    assert called("dialect", "--path").output == f"{folder}\n"
    printed = ElementTree.fromstring(called("dialect").output)
    names = {message.get("name") for message in printed.iter("message")}
    assert {"TASK_STATUS", "TASK_QUEUE_STATUS", "TASK_TIMING"} <= names
    for include in printed.iter("include"):
        assert include.text == "common.xml"
    assert (folder / "base_additions.xml").is_file()
    assert (folder / DIALECT).is_file()
