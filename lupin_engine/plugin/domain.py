"""Validates ROS domain ids. Python 3.6 can read this: `tools/bootstrap.py` uses it before it installs.

The UDP ports of a domain begin at 7400 + 250 * domain, so that 232 is the last one. Linux hands out the ports
from 32768 to 60999 to any process, which are those of the domains from 102 to 214: a node there may find its
port taken. See https://docs.ros.org/en/jazzy/Concepts/Intermediate/About-Domain-ID.html
"""

import os
import re
from typing import Mapping

DOMAIN = "ROS_DOMAIN_ID"
ADVICE = "use a number from 0 to 101 or from 215 to 232"


def is_domain(text: str) -> bool:
    """Say whether this is the number of a domain whose ports no other process gets."""
    number = int(text) if re.match("(0|[1-9][0-9]{0,2})$", text) else -1
    return 0 <= number <= 101 or 215 <= number <= 232


def domain_advice(environment: Mapping[str, str] = os.environ) -> str:
    """Return the advice about the domain that the shell has set; '' where nothing is wrong with it."""
    text = environment.get(DOMAIN, "").strip()
    return "" if is_domain(text) or not text else ADVICE
