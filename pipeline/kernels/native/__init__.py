"""Exact geodesics in C++: `core`, built from the sources beside this file."""
