"""The verbs: what a user asks for in one breath, composed from the rooms below."""
