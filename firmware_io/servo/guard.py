"""Small process that shares the servo's port and stops the servo if the driving program dies or hangs.

A killed program runs no handler. The guard inherits the open port and reads a pipe from the program. If the pipe ends
without a word (kill -9, crash) or stays silent while the servo turns (Ctrl-Z, hang), the guard sends the packet that
turns the torque off until it is answered. The port's lock lasts until then.

The file is also the guard's program: only the standard library, to start in 20 ms.
It cannot stop a servo whose bus is cut, or act after a power cut of the computer.
"""

from __future__ import annotations

import os
import select
import signal
import subprocess
import sys
import termios
import time

SILENCE_S = 2.0  # as long as a turning servo may go without a word from the program

_TURNING, _RESTING, _DONE = b"t", b"r", b"d"
_GIVE_UP_S = 2.0  # forty tries
_ANSWER_S = 0.05  # as `unit.PING_S`, which this program does not import


class Guard:
    """The program's end of the pipe.

    Args:
        port_fd: the open port.
        packet: what takes the servo's torque.
        answer: what the servo's answer to it begins with.
        silence_s: after how long without a word a turning servo is stopped.
    """

    def __init__(self, port_fd: int, packet: bytes, answer: bytes, silence_s: float = SILENCE_S) -> None:
        # A session of its own: Ctrl-C and the end of the terminal reach the program, not the guard.
        self._process = subprocess.Popen(
            [sys.executable, "-I", "-S", __file__, str(port_fd), packet.hex(), answer.hex(), str(silence_s)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            pass_fds=(port_fd,),
            start_new_session=True,
            bufsize=0,
        )
        assert self._process.stdin and self._process.stdout
        self._words, ready = self._process.stdin, self._process.stdout
        self._sent_s = 0.0
        with ready:
            if ready.read(1) != b"!":
                self._words.close()
                raise RuntimeError(f"the guard process did not start (exit {self._process.wait()})")

    def turning(self) -> bool:
        """The servo turns from now on, and the program is alive; False if the guard has stopped it."""
        return self._send(_TURNING)

    def resting(self) -> bool:
        """The servo stands; silence is fine."""
        return self._send(_RESTING)

    def beat(self) -> bool:
        """The program is alive, said at most ten times a second."""
        return time.monotonic() - self._sent_s < 0.1 or self._send(_TURNING)

    def dismiss(self, at_rest: bool) -> bool:
        """End the guard, which first stops the servo if it does not stand; whether it does now. May be called again."""
        if not self._words.closed:
            if at_rest:
                self._send(_DONE)
            self._words.close()
        return self._process.wait() == 0

    def _send(self, word: bytes) -> bool:
        self._sent_s = time.monotonic()
        try:
            self._words.write(word)
        except (BrokenPipeError, ValueError):  # it has ended, or was dismissed
            return False
        return True


def watch(port_fd: int, packet: bytes, answer: bytes, silence_s: float) -> None:
    """The guard's life: wait for the program's end, then stop the servo unless told that it stands."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT):
        signal.signal(number, signal.SIG_IGN)
    os.write(1, b"!")
    os.close(1)
    wait_s = None
    while select.select([0], [], [], wait_s)[0]:
        words = os.read(0, 4096)
        if words.endswith(_DONE):
            return
        if not words:
            break
        wait_s = silence_s if words.endswith(_TURNING) else None
    os.close(0)  # from here on the program hears that its guard has acted
    try:
        stop(port_fd, packet, answer)
    except (OSError, termios.error):  # the port is gone
        sys.exit(1)


def stop(port_fd: int, packet: bytes, answer: bytes) -> None:
    """Send the packet until it is answered; raises OSError if the port is gone or no answer comes."""
    end_s = time.monotonic() + _GIVE_UP_S
    while time.monotonic() < end_s:
        termios.tcflush(port_fd, termios.TCIFLUSH)  # an answer to the dead program is none to us
        os.write(port_fd, packet)
        received, until_s = b"", time.monotonic() + _ANSWER_S
        while select.select([port_fd], [], [], max(0.0, until_s - time.monotonic()))[0]:
            some = os.read(port_fd, 4096)
            if not some:
                raise OSError("the port is gone")
            received += some
            if answer in received:
                return
    raise OSError("no answer")


if __name__ == "__main__":
    watch(int(sys.argv[1]), bytes.fromhex(sys.argv[2]), bytes.fromhex(sys.argv[3]), float(sys.argv[4]))
