"""`rig` from its first moment: Ctrl-C ends it in silence also while it still loads."""

import sys

INTERRUPTED = 130  # what a shell says of a command that Ctrl-C ended


def main() -> None:
    """Entry point of the `rig` command."""
    try:
        from api.cli.app import main as run  # noqa: PLC0415 - what loads is inside

        run()
    except KeyboardInterrupt:
        sys.exit(INTERRUPTED)


if __name__ == "__main__":
    main()
