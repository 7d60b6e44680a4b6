"""How an intent moves a body."""
