"""Two webcams as a stereo camera: V4L2 devices, MJPEG over HTTP, or video files."""
