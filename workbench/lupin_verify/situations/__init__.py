"""Every situation that a machine can come to: what one is, what may come next, and the graph of all."""
