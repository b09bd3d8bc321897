"""From a crease pattern to sheets: patches, tabs, dashes, nesting, stroke order, drawings."""
