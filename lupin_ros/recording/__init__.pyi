from .reader import Recording as Recording
from .recorded import RecordedPages as RecordedPages
from .recorder import TopicRecorder as TopicRecorder
