"""What accuracy costs in time: every choice of switches, joints, tables, scans and decisions on one picture."""
