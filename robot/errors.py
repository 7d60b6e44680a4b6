"""Errors a person can mend: one line, with the cure. The command line prints them and exits 2."""

from __future__ import annotations


class UserError(ValueError):
    """Something the user gave is wrong. The message is one line and names the cure."""
