"""What is dear to make is made once in a session, by the worker that asks first; the others read it."""

import fcntl
import hashlib
import os
import pickle

_spared_s = 0.0


def busy_s():
    """Processor seconds so far, of this process and its children; what another worker or test made counts as well.

    So a test costs the same whoever came first, and it is known for slow where it happened to come last.
    """
    return sum(os.times()[:4]) + _spared_s


class MadeOnce:
    """What the workers of a session made, in a folder that they share.

    What is made goes through pickle. It is for reading only, and so are the files beside it.
    """

    def __init__(self, folder):
        self._folder, self._here = folder, {}

    def __call__(self, name, make):
        """What `make` gives when it is called with a folder for its files; `name` tells it from all else."""
        global _spared_s
        folder = self._folder / hashlib.sha256(name.encode()).hexdigest()[:16]
        if name in self._here:
            took_s, made = self._here[name]
            _spared_s += took_s
            return made
        folder.mkdir(exist_ok=True)
        with (folder / "lock").open("w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)  # not held any more by a worker that died
            kept = folder / "made.pickle"
            if kept.exists():
                took_s, made = pickle.loads(kept.read_bytes())
                _spared_s += took_s
            else:
                began = busy_s()
                made = make(folder / "files")
                took_s = busy_s() - began
                kept.with_suffix(".part").write_bytes(pickle.dumps((took_s, made)))
                kept.with_suffix(".part").rename(kept)
        self._here[name] = took_s, made
        return made
