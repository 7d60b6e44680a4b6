"""One file a state: what it wants to see, what it intends, when it leaves."""
