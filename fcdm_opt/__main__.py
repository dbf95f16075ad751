"""`fcdm-opt`, also as `python -m fcdm_opt`: loads the command line, and runs it."""

from __future__ import annotations

import signal
import threading

from fcdm_opt.threads import single


def main() -> None:
    """Entry point; an interrupt while the command line is loaded ends it without a word."""
    single()
    if threading.current_thread() is threading.main_thread():
        before = signal.signal(signal.SIGINT, signal.SIG_DFL)
        from fcdm_opt import cli

        signal.signal(signal.SIGINT, before)
    else:
        from fcdm_opt import cli
    try:
        cli.main()
    except KeyboardInterrupt:  # before it listens itself
        raise SystemExit(cli.guarding.INTERRUPTED) from None


if __name__ == "__main__":
    main()
