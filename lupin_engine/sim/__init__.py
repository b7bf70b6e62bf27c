"""The loop in virtual time: scripted plugins, simulations, scenarios."""
