from .reader import Recording as Recording
from .recorded import RecordedPages as RecordedPages
from .recorder import TopicRecorder as TopicRecorder
from .unpacked import unpack_learnable as unpack_learnable
