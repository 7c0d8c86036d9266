"""Polls of a load cell that sends nothing by itself: one at a time, each when it is due."""

from __future__ import annotations

from collections.abc import Callable

from drivers.loadcell import ForceSample
from drivers.wire import Exchange, Link, Pause, Steps


class Polls:
    """The polls of one device. `ask()` makes the exchange, `interval_s()` says how far apart they are, in seconds.

    A poll that fails gives no sample; the next one is due as if it had been answered. An answer of None is none either.
    """

    def __init__(
        self, link: Link, ask: Callable[[], Exchange[ForceSample | None]], interval_s: Callable[[], float]
    ) -> None:
        self._link = link
        self._ask = ask
        self._interval_s = interval_s
        self._poll: Exchange[ForceSample | None] | None = None
        self._due_s: float | None = None

    @property
    def running(self) -> bool:
        """Whether polls are made."""
        return self._due_s is not None

    def begin(self) -> None:
        """The first poll is due now."""
        self._due_s = self._link.clock.now()

    def serve(self) -> list[ForceSample]:
        """What the last poll gave, if it is answered; submits the next one if it is due."""
        poll = self._poll
        samples: list[ForceSample] = []
        if poll is not None and poll.done:
            self._poll = None
            sample = poll.result() if poll.error is None else None
            if sample is not None:
                samples.append(sample)
        if self._due_s is not None and self._poll is None and self._link.broken is None:
            now = self._link.clock.now()
            if now >= self._due_s:
                self._poll = self._link.submit(self._ask())
                self._due_s = max(self._due_s + self._interval_s(), now)
        return samples

    def next_s(self) -> float | None:
        """When the next poll is due (bench clock).

        None while the last one is unanswered, as its answer wakes whoever waits; and where the port is lost, since a
        poll that is due for ever would not let anybody wait.
        """
        waiting = self._poll is not None and not self._poll.done
        return None if waiting or self._link.broken is not None else self._due_s

    def forget(self) -> None:
        """Poll no more; what the last poll gives is nobody's."""
        self._due_s = self._poll = None

    def end(self) -> Steps[None]:
        """Poll no more, and let the last poll be answered."""
        self._due_s = None
        while self._poll is not None and not self._poll.done:
            yield Pause(0.001)
        self._poll = None
