"""What the tests of campaigns put in the place of an audit whose package takes long to import."""

import time

from campaign_functions import answers

__all__ = ["answers"]
time.sleep(2.0)
