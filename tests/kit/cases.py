"""Several cases of a scenario in one test, which names those that fail."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import wraps
from inspect import Parameter, signature
from itertools import product
from typing import Any

import pytest

from tests.kit.volume import LONG

Test = Callable[..., None]
Axis = tuple[Sequence[str], Sequence[Any]]  # names of parameters, and their values

MAKERS: dict[tuple[str, str], Callable[..., Any]] = {}
SHARED = "tests.scenarios.conftest"


def anew(make: Callable[..., Any]) -> Any:
    """Make a fixture of a function; each case of ``for_each`` calls the function anew."""
    MAKERS[make.__module__, make.__name__] = make
    return pytest.fixture(make)


def for_each(names: str | Sequence[str], values: Iterable[Any]) -> Callable[[Test], Test]:
    """Run a test once for each of these values, each time with fixtures made anew.

    Of several such decorators, each value of each is used; a long run (``kit/volume.py``) uses all
    combinations.
    """
    axis = (names.split(", ") if isinstance(names, str) else names, list(values))

    def decorate(test: Test) -> Test:
        plain: Test = getattr(test, "plain", test)
        axes: list[Axis] = [*getattr(test, "axes", []), axis]
        given = {name for names, _ in axes for name in names}

        @wraps(plain)
        def run(*args: Any, **fixtures: Any) -> None:
            failures = []
            for number, case in enumerate(cases(axes)):
                if "tmp_path" in fixtures:
                    fixtures["tmp_path"] /= str(number)
                    fixtures["tmp_path"].mkdir()
                if "caplog" in fixtures:
                    fixtures["caplog"].clear()
                try:
                    plain(*args, **arguments(plain, fixtures | case))
                except Exception as error:  # noqa: BLE001 - the other cases are tried, too
                    error.add_note("with " + ", ".join(f"{k}={v!s:.200}" for k, v in case.items()))
                    failures.append(error)
            if len(failures) == 1:
                raise failures[0]
            if failures:
                raise ExceptionGroup(f"{len(failures)} cases", failures)

        needed = [
            Parameter(name, Parameter.POSITIONAL_OR_KEYWORD)
            for name in dict.fromkeys(needs(plain, plain.__module__, given))
        ]
        marks = [mark for mark in vars(test).get("pytestmark", []) if mark.name != "timeout"]
        limit = pytest.mark.timeout(120 + 30 * sum(1 for _ in cases(axes))).mark
        vars(run).update(plain=plain, axes=axes, pytestmark=[*marks, limit])
        vars(run)["__signature__"] = signature(plain).replace(parameters=needed)
        return run

    return decorate


def cases(axes: Sequence[Axis]) -> Iterator[dict[str, Any]]:
    """Yield arguments in which each value of each axis occurs."""
    most = max(len(values) for _, values in axes)
    shifted = (  # by another number for each axis, so that values do not meet in one order only
        [values[(n + n // len(values) + k) % len(values)] for k, (_, values) in enumerate(axes)]
        for n in range(most)
    )
    for row in product(*(values for _, values in axes)) if LONG else shifted:
        case: dict[str, Any] = {}
        for (names, _), value in zip(axes, row, strict=True):
            case.update(zip(names, value if len(names) > 1 else (value,), strict=True))
        yield case


def maker_of(name: str, module: str) -> Callable[..., Any] | None:
    """Return the function that makes a fixture anew, if there is one."""
    return MAKERS.get((module, name)) or MAKERS.get((SHARED, name))


def needs(function: Callable[..., Any], module: str, given: set[str]) -> Iterator[str]:
    """Yield the fixtures that a function needs and that are not made anew."""
    for name in signature(function).parameters:
        if name not in given:
            maker = maker_of(name, module)
            if maker:
                yield from needs(maker, module, given)
            else:
                yield name


def arguments(plain: Test, known: dict[str, Any]) -> dict[str, Any]:
    """Return the arguments of a test; what is to be made anew is made."""

    def of(function: Callable[..., Any]) -> dict[str, Any]:
        return {name: value(name) for name in signature(function).parameters if name != "self"}

    def value(name: str) -> Any:
        if name not in known:
            maker = maker_of(name, plain.__module__)
            assert maker, name
            known[name] = maker(**of(maker))
        return known[name]

    return of(plain)
