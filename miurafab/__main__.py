"""``python -m miurafab`` is the command line."""

from miurafab.cli import main

if __name__ == "__main__":
    main()
