"""The cockpit: one robot, simulated or real, in a browser on this machine."""
