"""What the cameras know: tags on the map, flowers in their boxes, pests.

`catalog` says what missions are offered and loads without ROS; `client` is the engine's side. The aggregator
is `node` around plain Python: `detections` reads what detectors say, `sightings` places tags on the map,
`registry` remembers them, `boxes` is the geometry of planters, `layout` knows where they are; `flowers` and
`anomalies` fuse what is seen. `idle` says what is read without a mission, `memory` outlives the process.
"""
