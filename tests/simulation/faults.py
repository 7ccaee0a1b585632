"""Faults that there were, to be put in again: does the simulation find them?

Each is a line of the product and what stood there, or might as well have. ``tools/simulate --fault
NAME`` plays the 20 stories of CI until one finds it. So many stories, from seed 0, were
played until it was found: C1 17, C4 10, C5 1, C6 19, D1 2, D2 3, D3 6, D4 17, D10 20, a late mode
4, a late arming 16, STOP 9, nonces 12, a lease 12, a rival 12, an end told too early 19. With
another story of a seed these figures change: what finds a fault in 24 stories may need 60 the next
time.
"""

COMMANDS, VEHICLES = "engine/commands", "engine/vehicles"
#: name: file, line, what takes its place
FAULTS: dict[str, tuple[str, str, str]] = {
    "C1 order by reading": ("engine/engine.py", "arrived=arrived", "arrived=now"),
    "C4 moved times are kept": (
        "tasks/times.py",
        "if len(self._heap) > 2",
        "if len(self._heap) > 999",
    ),
    "C5 a disarmed rover's tasks go": (
        "tasks/lineup.py",
        "return at >= task.submitted_at or (bool",
        "return (bool",
    ),
    "C6 halts are answered at once": (
        f"{COMMANDS}/submissions.py",
        "self.gate.hold(accept, give_up, now=now, is_halt=not ends_tasks)",
        "accept(now=now)",
    ),
    "D1 an older go is obeyed": (
        f"{COMMANDS}/ordering.py",
        "if words := why_older(asked, now=now):",
        "if (words := why_older(asked, now=now)) and False:",
    ),
    "D2 overtaken go is obeyed": (
        f"{COMMANDS}/ordering.py",
        "epoch = halts.epoch if halts.at < sent_after else halts.epoch - 1",
        "epoch = halts.epoch",
    ),
    "D3 late ticks are not noticed": (
        f"{VEHICLES}/joint_control.py",
        "if self._pilot.is_late(now=now):",
        "if False:",
    ),
    "D4 a backlog is new": (
        "engine/clients/gcs_client.py",
        "return self.waited > OLD",
        "return False",
    ),
    "D10 parking counts for nothing": (
        f"{VEHICLES}/takeovers.py",
        "                self._look_for_parking(was_mode, mode, now=now)",
        "                pass",
    ),
    "a late mode undoes a halt": (
        f"{VEHICLES}/control.py",
        "_row(_E.LATE_MODE, _F.TELL, _F.LET_GO)",
        "_row(_E.LATE_MODE, _F.TELL)",
    ),
    "a late arming undoes a disarming": (
        f"{VEHICLES}/control.py",
        "_row(_E.LATE_ARMING, _F.TELL, _F.DISARM, work=Work.NONE)",
        "_row(_E.LATE_ARMING, _F.TELL, work=Work.NONE)",
    ),
    "STOP lets sticks pass": (
        f"{COMMANDS}/motion_gate.py",
        "    if not row.passes_under_stop and vehicle.tasks.is_stopped:\n        return",
        "    if False:\n        return",
    ),
    "nonces are not looked at": ("tasks/deduplicator.py", "if draft.marks.nonce:", "if False:"),
    "a lease lasts longer than rivals count": (
        "fleet/lease.py",
        "        self._renewed = sent\n        if now",
        "        self._renewed = sent + 2.0\n        if now",
    ),
    "a rival is evicted at once": (
        "fleet/rivals.py",
        "now - seen.since >= self.terms.term",
        "now - seen.since >= 0.3",
    ),
    "an end is told too early": (
        "engine/clients/publisher.py",
        "self._ended |= ended",
        "pass",
    ),
}
