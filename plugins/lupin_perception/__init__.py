"""What the cameras know: tags on the map, flowers in their boxes, pests.

`catalog` says what missions are offered and loads without ROS; `client` is the engine's side. The aggregator
is `node` around plain Python: `detections` reads what detectors say, `transforms` places it on the map,
`registry` remembers tags, `boxes` is the geometry of planters, `flowers` and `anomalies` fuse what is seen.
"""
