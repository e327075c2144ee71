"""Methods that choose switches, one file per method or family; `base` defines a method and finds them all."""
