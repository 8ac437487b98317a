"""REST and websockets: parse, wish or read, answer."""
