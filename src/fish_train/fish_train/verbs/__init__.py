"""Verbs of the `fish_train` command: one file each, listed in verbs.VERBS."""
