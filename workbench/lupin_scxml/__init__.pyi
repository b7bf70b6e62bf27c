from .elements import read_document as read_document
from .importer import from_scxml as from_scxml
