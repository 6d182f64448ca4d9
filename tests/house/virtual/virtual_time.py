"""A clock of several threads, which goes forward only when all of them wait: one runs at a time, in the same order."""

import sys
import threading
from collections import deque
from queue import Empty
from types import ModuleType


def replace_time(clock, monkeypatch, *packages):
    """Put a clock in the place of the module `time` in all modules of packages that have been imported."""
    for name, module in list(sys.modules.items()):
        if name.startswith(packages) and isinstance(getattr(module, "time", None), (ModuleType, VirtualTime)):
            monkeypatch.setattr(module, "time", clock)


class VirtualTime:
    """Stands in for the module `time`, and makes the threads, events and queues that wait on it.

    Attributes:
        now_ns: the time, `time.monotonic_ns()`.
        wall_minus_monotonic_ns: somebody may set the wall clock.
    """

    def __init__(self):
        self.now_ns = 10**12
        self.wall_minus_monotonic_ns = 10**18
        self._waiting = {}  # thread -> until when, and what ends its wait before
        self._gates = {}  # thread -> a lock that opens when it is its turn: a condition would wake all of them

    def monotonic(self):
        return self.now_ns / 1e9

    def monotonic_ns(self):
        return self.now_ns

    def time_ns(self):
        return self.now_ns + self.wall_minus_monotonic_ns

    def sleep(self, seconds):
        self.wait(self.now_ns + round(max(seconds, 0) * 1e9))

    def until(self, condition, seconds=300.0):
        """Wait for something to be so."""
        end_ns = self.now_ns + round(seconds * 1e9)
        while not condition():
            assert self.now_ns < end_ns, "it did not come to that in time"
            self.sleep(0.005)

    def stop_all(self, seconds):
        """The process gets no processor for a while: nobody runs, and all find themselves late."""
        self.now_ns += round(seconds * 1e9)

    def wait(self, until_ns, ended=lambda: False):
        """Let the others run until then, or until something is so."""
        me = threading.get_ident()
        self._waiting[me] = until_ns, ended
        if not self._next(me):
            self._gate(me).acquire()

    def _gate(self, thread):
        shut = threading.Lock()
        shut.acquire()
        return self._gates.setdefault(thread, shut)

    def _next(self, me=None):
        """Go on to the thread that is due first; return whether that is the one that asks."""
        due_ns = {one: self.now_ns if ended() else until for one, (until, ended) in self._waiting.items()}
        running = min(due_ns, key=due_ns.get)
        self.now_ns = max(self.now_ns, due_ns[running])
        del self._waiting[running]
        if running != me:
            self._gate(running).release()
        return running == me

    def put_in_place_of_time(self, monkeypatch, *packages):
        """In all modules of packages that have been imported."""
        replace_time(self, monkeypatch, *packages)

    def Event(self):
        return _Event(self)

    def SimpleQueue(self):
        return _Queue(self)

    def Thread(self, **options):
        return _Thread(self, **options)


class OnClock:
    """What has a clock, perhaps its own, and can stand in for `time`: to set `now_ns` is to wait."""

    def __init__(self, clock=None):
        self.clock = VirtualTime() if clock is None else clock
        self.monotonic, self.monotonic_ns, self.sleep = self.clock.monotonic, self.clock.monotonic_ns, self.clock.sleep

    @property
    def now_ns(self):
        return self.clock.now_ns

    @now_ns.setter
    def now_ns(self, until_ns):
        self.clock.wait(until_ns)


class _Event:
    def __init__(self, clock):
        self._clock, self._set = clock, False

    def is_set(self):
        return self._set

    def set(self):
        self._set = True

    def wait(self, timeout=1e6):
        self._clock.wait(self._clock.now_ns + round(timeout * 1e9), self.is_set)
        return self._set


class _Queue:
    def __init__(self, clock):
        self._clock, self._waiting = clock, deque()

    def empty(self):
        return not self._waiting

    def put(self, item):
        self._waiting.append(item)

    def get(self, timeout=1e6):
        self._clock.wait(self._clock.now_ns + round(timeout * 1e9), lambda: bool(self._waiting))
        if not self._waiting:
            raise Empty
        return self._waiting.popleft()


class _Thread(threading.Thread):
    """Its turn comes when whoever started it waits."""

    def __init__(self, clock, **options):
        super().__init__(**options)
        self._clock, self._over = clock, False

    def start(self):
        super().start()
        self._clock._waiting[self.ident] = self._clock.now_ns, lambda: False

    def run(self):
        self._clock._gate(threading.get_ident()).acquire()
        try:
            super().run()
        finally:
            self._over = True
            self._clock._next()

    def join(self, timeout=None):
        self._clock.wait(self._clock.now_ns + 10**15, lambda: self._over)
        super().join(timeout)
