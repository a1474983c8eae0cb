"""Watches a drive: where the ground changes, where senses contradict each other, and what is to be told."""

from __future__ import annotations

import threading
from collections.abc import Callable

from .events import Event, GroundChanged, SensesContradict
from .ground import GroundByNow, WayByNow
from .observing import described
from .track import LiveTrack

PERIOD_S = 0.1
"""The way is looked at so often [s]."""

Subscriber = Callable[[Event], None]


class Watch:
    """Looks at the way in a thread of its own, and tells subscribers.

    Parameters
    ----------
    track
        Where the vehicle is.
    ground
        What is believed of the ground.
    way
        The class along the way.
    begin_stretch
        Called where the ground changes, with the time [s] and its class.
    """

    def __init__(
        self, track: LiveTrack, ground: GroundByNow, way: WayByNow, begin_stretch: Callable[[float, str], None]
    ):
        self._track, self._ground, self._way, self._begin_stretch = track, ground, way, begin_stretch
        self._subscribers: list[Subscriber] = []
        self._ends = threading.Event()
        self._contradicts = False
        self.fault = ""
        self._thread = threading.Thread(target=self._work, name="bevameter watch", daemon=True)

    def subscribe(self, subscriber: Subscriber) -> None:
        """Call a subscriber with each event from now on, in the thread of the watch."""
        self._subscribers.append(subscriber)

    def tell(self, event: Event) -> None:
        """Tell all subscribers; one that fails keeps nothing from the others."""
        for each in list(self._subscribers):
            try:
                each(event)
            except Exception as error:
                self.fault = f"a subscriber failed: {described(error)}"

    def begin(self) -> None:
        """Begin to watch."""
        self._thread.start()

    def end(self) -> None:
        """Watch what is left of the way, and end."""
        self._ends.set()
        self._thread.join()

    def _work(self) -> None:
        while not self._ends.wait(PERIOD_S) and threading.main_thread().is_alive():
            self._try_to_look()
        self._try_to_look()

    def _try_to_look(self) -> None:
        try:
            self._look()
        except Exception as error:  # what cannot be judged now may be in a moment
            self.fault = f"the way cannot be judged: {described(error)}"

    def _look(self) -> None:
        track = self._track.now()
        if track is None:
            return
        before = self._way.now.class_name if self._way.now is not None else ""
        for new in self._way.go_on(track, self._ground):
            self._begin_stretch(new.since_s, new.class_name)
            probability = new.probabilities.get(new.class_name, 0.0)
            if new.class_name != before:  # the first piece may be of no class
                self.tell(GroundChanged(new.since_s, before, new.class_name, probability))
            before = new.class_name
        contradicts = bool(self._way.contradiction)
        if contradicts and not self._contradicts and self._way.now is not None:
            self.tell(SensesContradict(self._way.now.time_s, self._way.contradiction))
        self._contradicts = contradicts
