"""A small robot that searches, recognizes, ranges, tracks and avoids with two webcams."""

__version__ = "0.1.0"
