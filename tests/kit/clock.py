"""A clock that stands still until a test moves it."""


class Clock:
    """Stands in for a clock of the code under test."""

    def __init__(self) -> None:
        self.now = 100.0

    def __call__(self) -> float:
        return self.now
