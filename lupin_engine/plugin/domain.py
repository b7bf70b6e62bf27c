"""Reads ROS domain ids, for all commands. Python 3.6 can read this: `tools/bootstrap.py` uses it first.

The UDP ports of a domain begin at 7400 + 250 * domain, so that 232 is the last one. Linux hands out the ports
from 32768 to 60999 to any process, which are those of the domains from 102 to 214: a node there may find its
port taken. See https://docs.ros.org/en/jazzy/Concepts/Intermediate/About-Domain-ID.html
"""

import re

DOMAIN = "ROS_DOMAIN_ID"


def domain_number(text: str, said: str = DOMAIN) -> int:
    """Return the number of a domain whose ports no other process gets; `said` is what names it.

    Rcl takes a number that begins with 0 for an octal or hexadecimal one, so there is none here.

    Raises:
        ValueError: it is none.
    """
    number = int(text) if re.match("(0|[1-9][0-9]{0,2})$", text) else -1
    if not (0 <= number <= 101 or 215 <= number <= 232):
        raise ValueError("{} is {!r}: use a number from 0 to 101 or from 215 to 232".format(said, text))
    return number
