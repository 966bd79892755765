"""The command line ``python -m pendbench.study NAME-or-FILE``."""

import signal

from pendbench.commands.shell import leave, terminate
from pendbench.commands.study import main

if __name__ == "__main__":
    signal.signal(signal.SIGTERM, terminate)
    leave(main())
