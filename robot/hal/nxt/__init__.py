"""LEGO NXT brick: protocol codec and drive base."""
