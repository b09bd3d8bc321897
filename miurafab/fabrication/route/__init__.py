"""The order of strokes: postman routes, tours, and the order of operations on a sheet."""
