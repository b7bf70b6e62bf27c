"""Perception: tags on the map, flowers in their boxes, pests.

`catalog` is the offer to missions, without ROS; `client` the driver in the orchestrator; `node` the
aggregator around plain Python: `detections` parses, `sightings` places tags, `registry` keeps them, `boxes`
and `layout` are the planters' geometry, `flowers` and `anomalies` fuse detections, `idle` schedules readings
without a mission, `memory` saves state for a restart.
"""
