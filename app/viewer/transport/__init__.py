"""Transport of the scene's changes to the browsers: collected, encoded once, sent to every client with room for them.

scene_updates     latest value of everything that changes, and the frame that changed it
broadcaster       encoding of a frame, once for all clients that need the same
client_messages   what browsers may send, checked before viser sees it
client_registry   connected browsers, and the page that each belongs to
viser_private     the only module that knows private names of viser
"""
