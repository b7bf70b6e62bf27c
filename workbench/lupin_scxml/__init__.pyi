from .elements import read_document as read_document
from .exporter import scxml as scxml
from .importer import from_scxml as from_scxml
