"""The command line on odd machines: full disks, little memory, signals, strangers, old terminals."""
