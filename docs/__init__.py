"""Documents, and the scripts that make some of them, with linear algebra in one thread as the commands have it."""

from bench.one_thread import one_thread

one_thread()
