"""``python -m clutchest`` is the command ``clutchest``."""

from clutchest.cli import main

main()
