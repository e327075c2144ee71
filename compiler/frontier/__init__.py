"""The trade-off of accuracy and time: choices of switches, joints, tables, scans and decisions, and their fronts."""
