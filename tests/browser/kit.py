"""A page in the browser, and what it must never do: log an error, or ask another host."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import pytest

from tests.browser.conftest import OF_THE_BROWSER
from tests.kit.web import Web

DESKTOP = (1280, 800)
PHONE = (360, 740)
LIMIT = 45_000  # ms
HOSTILE = "<img src=x onerror=boom>"  # as long as a label may be
SERIOUS = ("serious", "critical")

axe_module = pytest.importorskip(
    "axe_playwright_python.sync_playwright", reason="axe-playwright-python is missing"
)


@contextmanager
def opened(
    chromium: Any,
    it: Web,
    *,
    path: str = "/",
    size: tuple[int, int] = DESKTOP,
    scheme: str = "light",
    waits: bool = True,
    may_fail: bool = False,
    touch: bool = False,
    before: Callable[[Any], None] = lambda _page: None,
) -> Iterator[Any]:
    """Yield a page; afterwards its console must hold no error.

    ``waits``: until it shows a rover. ``may_fail``: the browser may log answers that are refusals.
    ``touch``: its pointer is a finger. ``before`` is called with the page before it loads anything.
    """
    context = chromium.new_context(
        viewport={"width": size[0], "height": size[1]},
        color_scheme=scheme,
        locale="en-GB",
        has_touch=touch,
        is_mobile=touch,
    )
    page = context.new_page()
    page.set_default_timeout(LIMIT)
    said: list[str] = []
    asked: list[str] = []
    page.on(
        "console",
        lambda message: said.append(message.text) if message.type in ("error", "warning") else None,
    )
    page.on("pageerror", lambda error: said.append(f"uncaught: {error}"))
    page.on("request", lambda request: asked.append(request.url))
    before(page)
    try:
        page.goto(f"{it.url}{path}")
        if waits:
            page.wait_for_selector(".card")
            page.wait_for_selector(".rover-mark", state="attached")
        yield page
    finally:
        context.close()
    wrong = [text for text in said if not (may_fail and OF_THE_BROWSER in text)]
    assert not wrong, wrong
    strange = [url for url in asked if not url.startswith((f"{it.url}/", "blob:", "data:"))]
    assert not strange, strange


def text_of(page: Any, selector: str) -> str:
    """Return the text of an element, on one line."""
    return " ".join(str(page.inner_text(selector)).split())


def says(page: Any, selector: str, words: str) -> None:
    """Wait until an element's text has these words."""
    try:
        _wait_for_words(page, selector, words)
    except Exception as error:
        texts = [element.inner_text() for element in page.query_selector_all(selector)]
        raise AssertionError(f"{words!r} not in {texts}") from error


def _wait_for_words(page: Any, selector: str, words: str) -> None:
    page.wait_for_function(
        "([selector, words]) => [...document.querySelectorAll(selector)]"
        ".some((each) => !each.closest('[hidden]')"
        " && each.textContent.replace(/\\s+/g, ' ').includes(words))",
        arg=[selector, words],
    )


def press_resume(page: Any, where: str, words: str = "") -> None:
    """Resume a rover by the page, with these words in the dialogue.

    Again if the page says that something halted the rover since: on a busy machine the server may
    take the web process's copy of a pause after the page has shown the pause.
    """
    for _ in range(3):
        page.click(f"{where} >> text=Resume…")
        says(page, ".box", words)
        page.click(".box >> text='Resume'")
        page.wait_for_function(_ANSWERED)
        if not page.query_selector(".box"):
            return
        says(page, ".box .failure", "Something halted the rover after this page was drawn.")
        page.click(".box >> text='Back'")
    raise AssertionError("three times: something halted the rover")


_ANSWERED = (
    "() => !document.querySelector('.box') || document.querySelector('.box .failure:not([hidden])')"
)


def add(it: Web, goal: dict[str, Any], **terms: Any) -> Any:
    """Submit a task for rover 1; return it."""
    return it.post("/vehicles/1/tasks", {"goals": [goal]} | terms)


def move(it: Web, metres: float, **terms: Any) -> Any:
    """Submit a straight move of rover 1; return the task."""
    return add(it, {"kind": "move", "distance": metres}, **terms)


def judge(page: Any, where: str) -> None:
    """Fail if axe-core finds something serious in what the page shows."""
    found = axe_module.Axe().run(page).response["violations"]
    serious = [each for each in found if each["impact"] in SERIOUS]
    words = [(each["id"], [node["html"] for node in each["nodes"]][:3]) for each in serious]
    assert not words, (where, words)
