"""Watchdog process that stops the servo if the driving program dies or hangs.

A killed program runs no handler. The watchdog inherits the open port and reads a pipe from the program. If the pipe
closes without a message (kill -9, crash) or stays silent while the servo turns (Ctrl-Z, hang), it sends the packet that
turns the torque off until the servo replies. The port's lock lasts until then.

The file is also the program of the watchdog: only the standard library, to start in 20 ms.
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

SILENCE_S = 2.0  # longest time without a message from the program while the servo turns

_TURNING, _RESTING, _DONE = b"t", b"r", b"d"
_GIVE_UP_S = 2.0  # forty tries
_REPLY_S = 0.05  # as `unit.PING_S`, which this program does not import


class Guard:
    """The program's end of the pipe.

    Args:
        port_fd: descriptor of the open port.
        packet: turns the torque off.
        answer: first bytes of its reply.
        silence_s: time without a message after which a turning servo is stopped.
    """

    def __init__(self, port_fd: int, packet: bytes, answer: bytes, silence_s: float = SILENCE_S) -> None:
        # In a separate session, so Ctrl-C and the end of the terminal do not reach the watchdog.
        self._process = subprocess.Popen(
            [sys.executable, "-I", "-S", __file__, str(port_fd), packet.hex(), answer.hex(), str(silence_s)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            pass_fds=(port_fd,),
            start_new_session=True,
            bufsize=0,
        )
        assert self._process.stdin and self._process.stdout
        self._messages, ready = self._process.stdin, self._process.stdout
        self._sent_s = 0.0
        with ready:
            if ready.read(1) != b"!":
                self._messages.close()
                raise RuntimeError(f"the guard process did not start (exit {self._process.wait()})")

    def turning(self) -> bool:
        """Start to watch a turning servo; False if the watchdog has stopped it."""
        return self._send(_TURNING)

    def resting(self) -> bool:
        """Pause the watchdog while the servo is at rest."""
        return self._send(_RESTING)

    def beat(self) -> bool:
        """Send a sign of life, at most ten times a second; False if the watchdog has stopped the servo."""
        return time.monotonic() - self._sent_s < 0.1 or self._send(_TURNING)

    def dismiss(self, at_rest: bool) -> bool:
        """End the watchdog, which stops a servo not at rest; return whether it is now. Can be called again."""
        if not self._messages.closed:
            if at_rest:
                self._send(_DONE)
            self._messages.close()
        return self._process.wait() == 0

    def _send(self, message: bytes) -> bool:
        self._sent_s = time.monotonic()
        try:
            self._messages.write(message)
        except (BrokenPipeError, ValueError):  # it has ended, or was dismissed
            return False
        return True


def watch(port_fd: int, packet: bytes, answer: bytes, silence_s: float) -> None:
    """Wait for the end of the program, then stop the servo unless it is at rest."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT):
        signal.signal(number, signal.SIG_IGN)
    os.write(1, b"!")
    os.close(1)
    wait_s = None
    while select.select([0], [], [], wait_s)[0]:
        messages = os.read(0, 4096)
        if messages.endswith(_DONE):
            return
        if not messages:
            break
        wait_s = silence_s if messages.endswith(_TURNING) else None
    os.close(0)  # from here on writes of the program fail
    try:
        stop(port_fd, packet, answer)
    except (OSError, termios.error):  # the port is gone
        sys.exit(1)


def stop(port_fd: int, packet: bytes, answer: bytes) -> None:
    """Send the packet until a reply arrives; raises OSError if the port is gone or no reply arrives."""
    end_s = time.monotonic() + _GIVE_UP_S
    while time.monotonic() < end_s:
        termios.tcflush(port_fd, termios.TCIFLUSH)  # drop replies to the dead program
        os.write(port_fd, packet)
        received, until_s = b"", time.monotonic() + _REPLY_S
        while select.select([port_fd], [], [], max(0.0, until_s - time.monotonic()))[0]:
            data = os.read(port_fd, 4096)
            if not data:
                raise OSError("the port is gone")
            received += data
            if answer in received:
                return
    raise OSError("no answer")


if __name__ == "__main__":
    watch(int(sys.argv[1]), bytes.fromhex(sys.argv[2]), bytes.fromhex(sys.argv[3]), float(sys.argv[4]))
