"""How a command of this package ends."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Callable

from .paths import UserError


def leave(main: Callable[[], int | None]) -> None:
    """Runs main and exits with its status; quietly, as Unix commands do, when nobody reads on (`| head`).

    What the user can mend is one line and status 2.
    """
    status: int | None
    try:
        status = main()
        sys.stdout.flush()
    except UserError as error:
        print(f"error: {error}", file=sys.stderr)
        status = 2
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # nothing is left to complain at exit
        status = 128 + signal.SIGPIPE
    sys.exit(status)
