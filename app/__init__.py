"""The server: real-time runner, viser scene, REST, command line."""
