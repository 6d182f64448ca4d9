"""Imported first by a process, this takes the modules of POSIX systems away, as on Windows."""

import multiprocessing
import signal
import sys

for _name in ("fcntl", "termios", "resource", "pwd", "grp", "pty", "tty"):
    sys.modules[_name] = None
for _name in ("pthread_sigmask", "setitimer", "SIGHUP", "SIGQUIT"):
    delattr(signal, _name)
multiprocessing.get_all_start_methods = lambda: ["spawn"]
