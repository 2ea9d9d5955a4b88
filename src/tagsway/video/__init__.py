"""Read a video file as grey images with their true times, and write one."""
