"""The operator's console: a page that shows what the cell sees and intends, and commands it."""
