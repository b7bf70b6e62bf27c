from .behavior_trees import from_tree as from_tree
from .elements import read_document as read_document
from .exporter import scxml as scxml
from .importer import Imported as Imported
from .importer import from_scxml as from_scxml
