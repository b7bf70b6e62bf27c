"""The digital twin: what is known of every tag, kept through restarts, and sensor fields between the tags.

`catalog` says what the plugin offers and loads without ROS. `records` are the things that can be learnt,
`wire` reads them off messages, `state` is the table that they add up to, `store` keeps them on disk; `field`
is the interpolation, `heatmap` answers requests for it. All of that is plain Python; `node` is the server
over ROS.
"""
