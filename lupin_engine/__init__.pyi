from .api import load as load
from .api import machine_of as machine_of
from .api import simulate as simulate
from .api import test as test
from .errors import ChartError as ChartError
from .errors import LupinError as LupinError
from .errors import UsageError as UsageError
from .machine.event import Event as Event
from .machine.machine import Machine as Machine
from .machine.step import Step as Step
from .sim.simulation import Run as Run

__version__: str
