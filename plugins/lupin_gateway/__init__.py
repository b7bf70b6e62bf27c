"""The gateway: serves the console and rosbridge's protocol to browsers, with roles, limits and a software
stop."""
