"""The digital twin: the state of every tag, kept through restarts, and interpolated sensor fields.

`catalog` is the offer as data, without ROS; `records` are the facts, `wire` reads them off messages, `state`
folds them into the table of tags, `store` keeps them on disk; `field` interpolates, `heatmap` answers
requests. All that is plain Python; `node` is the server over ROS.
"""
