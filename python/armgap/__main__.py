"""The command line: ``python -m armgap`` does what ``armgap`` does."""

from armgap import cli

if __name__ == "__main__":
    cli.main()
