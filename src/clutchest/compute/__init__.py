"""From equations to compiled code."""
