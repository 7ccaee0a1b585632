"""Several cases of a scenario in one test, which names those that fail."""

from collections.abc import Callable, Container, Iterable, Iterator, Sequence
from functools import wraps
from inspect import Parameter, signature
from itertools import product
from typing import Any

from tests.kit.volume import LONG

Test = Callable[..., None]
Axis = tuple[Sequence[str], Sequence[Any]]  # names of parameters, and their values


def for_each(names: str | Sequence[str], values: Iterable[Any]) -> Callable[[Test], Test]:
    """Run a test once for each of these values, each time in a new world.

    Of several such decorators, each value of each is used; a long run (``kit/volume.py``) uses all
    combinations.
    """
    axis = (names.split(", ") if isinstance(names, str) else names, list(values))

    def decorate(test: Test) -> Test:
        plain: Test = getattr(test, "plain", test)
        axes: list[Axis] = [*getattr(test, "axes", []), axis]

        @wraps(plain)
        def run(*args: Any, **fixtures: Any) -> None:
            failures = []
            for number, case in enumerate(cases(axes)):
                try:
                    plain(*args, **case, **anew(fixtures, number, wanted))
                except Exception as error:  # noqa: BLE001 - the other cases are tried, too
                    error.add_note(f"with {case}")
                    failures.append(error)
            if len(failures) == 1:
                raise failures[0]
            if failures:
                raise ExceptionGroup(f"{len(failures)} cases", failures)

        wanted = signature(plain).parameters
        fixtures = {"make_world" if name == "world" else name: None for name in wanted}
        for name in (name for axis in axes for name in axis[0]):
            fixtures.pop(name)
        vars(run).update(plain=plain, axes=axes)
        kinds = [Parameter(name, Parameter.POSITIONAL_OR_KEYWORD) for name in fixtures]
        vars(run)["__signature__"] = signature(plain).replace(parameters=kinds)
        return run

    return decorate


def cases(axes: Sequence[Axis]) -> Iterator[dict[str, Any]]:
    """Yield arguments in which each value of each axis occurs."""
    most = max(len(values) for _, values in axes)
    shifted = (
        [values[(n + n // len(values)) % len(values)] for _, values in axes] for n in range(most)
    )
    for row in product(*(values for _, values in axes)) if LONG else shifted:
        case: dict[str, Any] = {}
        for (names, _), value in zip(axes, row, strict=True):
            case.update(zip(names, value if len(names) > 1 else (value,), strict=True))
        yield case


def anew(fixtures: dict[str, Any], number: int, wanted: Container[str]) -> dict[str, Any]:
    """Return the fixtures of a case: with a world and a folder of its own, and an empty log."""
    found = dict(fixtures)
    if "world" in wanted:
        found["world"] = found["make_world"]()
    if "make_world" not in wanted:
        found.pop("make_world", None)
    if "tmp_path" in found:
        found["tmp_path"] /= str(number)
        found["tmp_path"].mkdir()
    if "caplog" in found:
        found["caplog"].clear()
    return found
