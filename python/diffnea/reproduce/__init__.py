"""Studies that are run again by a command: ``python -m diffnea.reproduce --list``."""
