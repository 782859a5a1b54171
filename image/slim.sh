#!/bin/sh
# Removes from an installed environment what a service never reads: slim.sh FOLDER. Half of a gigabyte.
set -eu
cd "$1"/lib/python3*/site-packages
# Plug-ins of open3d for TensorFlow and PyTorch, its machine learning, examples and the files of its viewer.
rm -rf open3d/open3d_tf_ops.so open3d/open3d_torch_ops.so open3d/examples open3d/resources open3d/labextension \
    open3d/nbextension open3d/static
# What plotly and dash, which open3d imports, send to browsers.
rm -rf plotly/package_data plotly/labextension
find dash -name '*.js' -delete
find dash -name '*.map' -delete
# Tests, headers, sources, and libraries to link against.
find . -depth -type d \( -name tests -o -name include \) -exec rm -rf {} +
find . -type f \( -name '*.a' -o -name '*.pyx' -o -name '*.pxd' -o -name '*.h' -o -name '*.hpp' -o -name '*.c' \
    -o -name '*.cpp' -o -name '*.pyi' \) -delete
# Wheels hold no links: pymeshlab has the same library under two and three names.
python3 - <<'PYTHON'
import hashlib, pathlib
known = {}
for path in sorted(pathlib.Path("pymeshlab/lib").rglob("*.so*"), key=lambda path: (-len(path.name), path.name)):
    first = known.setdefault((path.parent, hashlib.sha256(path.read_bytes()).digest()), path)
    if first is not path:
        path.unlink()
        path.symlink_to(first.name)
PYTHON
