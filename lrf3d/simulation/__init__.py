"""The simulation: a robot drives, scans and maps in one loop (Fig. 2 of Teslić et al.)."""
