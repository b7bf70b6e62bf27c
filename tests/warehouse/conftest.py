"""The scenarios are tried where the package is installed: see test_simulated.py."""

collect_ignore_glob = ["scenarios/*"]
