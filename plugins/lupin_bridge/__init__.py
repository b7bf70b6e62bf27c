"""The greenhouse bridge: sensor readings at tags. The smallest plugin, and the template for others.

`catalog` is its offer as data, without ROS; `greenhouse` the domain, plain Python; `client` the driver in
the orchestrator; `node` the server.
"""
