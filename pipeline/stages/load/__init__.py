"""Reads a mesh file and converts it to millimetres: one module a format, behind `load`."""

from pipeline.stages.load.reading import Loaded, load

__all__ = ["Loaded", "load"]
