"""``python -m nineaudit``."""

from nineaudit.cli import main

main()
