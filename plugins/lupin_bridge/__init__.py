"""The greenhouse bridge: sensor readings at tags. The smallest plugin, and the template for others.

`catalog` says what the plugin offers and loads without ROS; `greenhouse` is the domain, plain Python;
`client` is the engine's side over ROS; `node` is the server's side over ROS.
"""
