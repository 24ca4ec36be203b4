"""The program ``lrf3d``, also as ``python -m lrf3d``."""

import os


def main() -> None:
    """Run the program; an interrupt while it loads is one line, too."""
    status = 130
    try:
        from lrf3d.apps.cli import program
        from lrf3d.base.interrupts import asked, limit_patience

        program.open_streams()
        limit_patience("lrf3d")
        program.main()
    except KeyboardInterrupt:
        os.write(2, b"lrf3d: stopped\n")
    except SystemExit as end:
        if not asked():
            raise
        status = int(end.code or 0)
    # All is written and flushed. Python would take a second to unload compiled libraries.
    os._exit(status)


if __name__ == "__main__":
    main()
