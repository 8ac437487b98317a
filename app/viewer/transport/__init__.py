"""How changes of the scene reach the browsers: collected, encoded once, sent to whoever has room."""
