"""What runs in the child process: standard library only, so that it starts fast and holds little that can break."""
