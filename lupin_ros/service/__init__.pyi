from . import names as names
from .folder import MissionsFolder as MissionsFolder
from .names import ACCESS as ACCESS
from .names import COMMAND_SERVICE as COMMAND_SERVICE
from .simulated import SimulatedPages as SimulatedPages
