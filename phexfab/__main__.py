"""``python -m phexfab`` is the command ``phexfab``."""

from phexfab.cli import main

if __name__ == "__main__":
    main()
