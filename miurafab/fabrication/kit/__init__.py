"""The folder's kit: rows, fold angles and folded states, for the person who folds."""
