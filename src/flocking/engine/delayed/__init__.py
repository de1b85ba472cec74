"""The engine for delayed knowledge and for messages under continuous control: steps of order 8 on what is known."""
