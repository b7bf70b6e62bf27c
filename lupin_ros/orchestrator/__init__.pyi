from .missions import OWN_PARAMETERS as OWN_PARAMETERS
