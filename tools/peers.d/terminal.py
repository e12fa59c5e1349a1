"""What tools/peers says while it works, and when it cannot go on."""

import sys


def progress(text=""):
    """One line on a terminal, which the next one replaces; nothing in a pipe."""
    if sys.stderr.isatty():
        print(f"\r\033[K{text}", end="", file=sys.stderr, flush=True)


def stop(message):
    progress()
    print(f"peers: {message}", file=sys.stderr)
    sys.exit(1)
