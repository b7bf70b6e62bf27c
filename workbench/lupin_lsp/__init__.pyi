from .schema import ANY_KIND as ANY_KIND
from .schema import all_schemas as all_schemas
from .schema import kinds as kinds
from .schema import text_of as text_of
from .schema import write as write
from .server import serve as serve
