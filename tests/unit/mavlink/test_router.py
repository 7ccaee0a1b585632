from mav_tasks.mavlink.router import Router


def test_a_system_is_where_it_was_last_heard() -> None:
    router = Router()
    router.learn(1, ("udp", "a"))
    router.learn(2, ("udp", "b"))
    router.learn(1, ("serial", "c"))
    assert [router.place_of(1), router.place_of(2)] == [("serial", "c"), ("udp", "b")]


def test_a_system_never_heard_is_nowhere() -> None:
    router = Router()
    assert router.place_of(1) is None
