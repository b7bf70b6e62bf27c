"""Starting, watching and stopping the processes of a run, and following the mission that they carry out."""
