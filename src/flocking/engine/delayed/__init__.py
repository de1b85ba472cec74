"""The engine for delayed knowledge under continuous control: delay differential equations by the method of steps."""
